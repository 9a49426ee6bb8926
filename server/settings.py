"""The settings of one server, read once from the environment (`HATLAB_…`).

Nothing else reads the environment.
"""

import re
from pathlib import Path

from pydantic import Field, SecretStr, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict

ADDRESS = re.compile(r"https?://[^\s/?#]+(/[^\s?#]*)?")
SITE = re.compile(r"https?://[a-z0-9.-]+(:\d{1,5})?")
PACKAGED_BUNDLES = Path(__file__).parents[1] / "models" / "bundles"


class Settings(BaseSettings):
    model_config = SettingsConfigDict(env_prefix="HATLAB_", frozen=True, extra="ignore")

    database_url: str = "sqlite:///var/hatlab.sqlite3"
    """SQLAlchemy URL. SQLite paths with three slashes are relative to the working directory."""
    admin_password: SecretStr | None = None
    """Password of the first admin. Unset: `hatlab init` draws one and prints it once."""
    secret_key: SecretStr | None = None
    """Root of participant keys and signatures.

    Unset: `hatlab init` draws one and keeps it in the database.
    """
    public_url: str = "http://127.0.0.1:8000"
    """Where browsers reach this server; participant links begin with it."""
    bundles: Path = PACKAGED_BUNDLES
    """Folder of released agents: `<task>/<name>/manifest.json`."""
    behind_https: bool = False
    """True behind a TLS proxy: cookies are Secure and HSTS is sent."""
    trusted_proxies: str = ""
    """Addresses of proxies (commas between) whose X-Forwarded-… headers are believed; empty: nobody's."""
    trial_cache: int = Field(default=256, ge=0)
    """Folded trials kept in memory by each worker; 0 turns the cache off. Never changes an answer."""
    body_max_bytes: int = Field(default=262_144, ge=1_024)
    """Largest request body that is read; room for a long consent text in any script, percent-encoded."""
    prolific_token: SecretStr | None = None
    """API token of the Prolific account that studies are published from. Unset: recruiting there is off."""
    prolific_api: str = "https://api.prolific.com/api/v1"
    """Root of Prolific's API; `hatlab fake-prolific` prints the one of a marketplace to try things with."""
    prolific_settle_s: float = Field(default=3_600, ge=0)
    """How long after a bonus Prolific's own list shows it for certain; one whose answer was lost waits so
    long before anybody looks and pays again."""
    prolific_webhook_secret: SecretStr | None = None
    """Secret that Prolific signs its messages with. Unset: no message is believed, changes are asked for."""
    mturk_endpoint: str = "https://mturk-requester-sandbox.us-east-1.amazonaws.com"
    """MTurk's requester API: the sandbox, where nobody is paid, unless another is named."""
    mturk_access_key_id: SecretStr | None = None
    """Access key of the MTurk requester."""
    mturk_secret_access_key: SecretStr | None = None
    """Secret half of it."""
    mturk_extra_host: str = ""
    """One site beside MTurk's own that may frame workers' pages and take their form: for development."""

    @field_validator("mturk_extra_host")
    @classmethod
    def a_site(cls, site: str) -> str:
        """Nothing but a scheme, a host and a port: it becomes part of a content policy."""
        if site and not SITE.fullmatch(site):
            raise ValueError("use a site like http://localhost:8100, without a path")
        return site

    @field_validator("public_url", "prolific_api", "mturk_endpoint")
    @classmethod
    def an_address(cls, url: str) -> str:
        """What links can begin with, without the final slash."""
        if not ADDRESS.fullmatch(url):
            raise ValueError("use an address like https://study.example.org")
        return url.rstrip("/")

    @field_validator(
        "secret_key",
        "admin_password",
        "prolific_token",
        "prolific_webhook_secret",
        "mturk_access_key_id",
        "mturk_secret_access_key",
    )
    @classmethod
    def not_empty(cls, secret: SecretStr | None) -> SecretStr | None:
        """An empty variable means unset, not an empty secret."""
        return secret if secret and secret.get_secret_value() else None
