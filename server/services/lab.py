"""What every service is handed: settings, database, loaded agents, the secret, the clock and the trial cache.

Built once, by `Lab.open`; there are no globals. `prepare` makes an installation that can be opened.
"""

import hashlib
import hmac
import secrets
from base64 import urlsafe_b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from typing import TYPE_CHECKING

from server.domain import canonical
from server.domain.errors import NotReadyError
from server.domain.study import Offer
from server.services.recent import Recent
from server.settings import Settings
from server.storage import installation
from server.storage.database import Database

if TYPE_CHECKING:
    from models.policies.bundle import PolicyBundle

SECRET = "secret_key"  # noqa: S105 the name of the row, not the secret
DEFINITIONS_KEPT = 64
SEED_BITS = 53  # exact in JavaScript and in spreadsheets


def clock() -> datetime:
    return datetime.now(UTC)


@dataclass(frozen=True)
class Lab:
    settings: Settings
    database: Database
    bundles: "Mapping[str, PolicyBundle]"
    bundle_errors: tuple[str, ...]
    secret_key: str
    now: Callable[[], datetime] = clock
    cache: Recent = field(default_factory=lambda: Recent(0))
    """Folded trials, by trial id and last digest."""
    definitions: Recent = field(default_factory=lambda: Recent(DEFINITIONS_KEPT))
    """Launched study versions, by id."""
    openings: Recent = field(default_factory=lambda: Recent(0))
    """Situations with a bundle's minds led into them: everybody plays the same ones."""

    @classmethod
    def open(cls, settings: Settings) -> "Lab":
        """The lab of an installation that is ready.

        Raises:
            NotReadyError: the database is missing, out of reach or not migrated.
        """
        ready = cls.without_agents(settings)
        from models.policies import bundle as released  # loads torch, which takes seconds
        from models.policies.serving import serving

        found, errors = released.find(settings.bundles)
        bundles = {name: replace(bundle, policy=serving(bundle.policy)) for name, bundle in found.items()}
        return replace(ready, bundles=bundles, bundle_errors=errors)

    @classmethod
    def without_agents(cls, settings: Settings) -> "Lab":
        """The same for what needs no agents: quick, for it does not load torch.

        Raises:
            NotReadyError: the database is missing, out of reach or not migrated.
        """
        database = Database(settings.database_url)
        if not database.is_current():
            raise NotReadyError(f"database {database.shown_url} is not migrated: run `hatlab init`")
        return cls(
            settings=settings,
            database=database,
            bundles={},
            bundle_errors=(),
            secret_key=secret_of(settings, database),
            cache=Recent(settings.trial_cache),
            openings=Recent(settings.trial_cache),
        )

    @cached_property
    def offers(self) -> dict[str, Offer]:
        """What a study may choose from."""
        return {name: offer_of(bundle) for name, bundle in self.bundles.items()}

    def agent(self, name: str, sha256: str | None = None) -> "PolicyBundle":
        """A loaded bundle; with `sha256` the very one that a stored trial was played with.

        Raises:
            NotReadyError: it is not loaded.
        """
        bundle = self.bundles.get(name)
        if bundle is None:
            raise NotReadyError(f"the agent {name} is not loaded: see `hatlab bundles`")
        if sha256 not in {None, bundle.sha256}:
            raise NotReadyError(f"the agent {name} is loaded, but not the one with sha256 {sha256}")
        return bundle

    def now_utc(self) -> str:
        return canonical.utc_text(self.now())

    def sealed(self, purpose: str, text: str) -> bytes:
        """HMAC-SHA256 under the secret key: for another purpose the same text gives something unrelated."""
        return hmac.digest(self.secret_key.encode(), f"{purpose}:{text}".encode(), hashlib.sha256)

    def participant_key(self, participant_id: str) -> str:
        """The unguessable part of a participant's address, 43 characters."""
        return urlsafe_b64encode(self.sealed("participant", participant_id)).decode().rstrip("=")

    def seed(self, participant_id: str) -> int:
        """The seed of everything that is drawn for a participant."""
        return int.from_bytes(self.sealed("seed", participant_id)[:8], "big") >> (64 - SEED_BITS)

    def external_hash(self, marketplace: str, external_id: str) -> str:
        """A marketplace id as a name that says nothing without the secret key."""
        return self.sealed(f"identity:{marketplace}", external_id).hex()


def prepare(settings: Settings) -> None:
    """Create or migrate the database and see to it that it has a secret key."""
    database = Database(settings.database_url)
    try:
        database.upgrade()
        with database.writing() as db:
            db.hold()
            if installation.value(db, SECRET) is None:
                installation.keep(db, SECRET, secrets.token_urlsafe(32))
    finally:
        database.close()


def secret_of(settings: Settings, database: Database) -> str:
    if settings.secret_key is not None:
        return settings.secret_key.get_secret_value()
    with database.reading() as db:
        secret = installation.value(db, SECRET)
    if secret is None:
        raise NotReadyError("no secret key: set HATLAB_SECRET_KEY or run `hatlab init`")
    return secret


def offer_of(bundle: "PolicyBundle") -> Offer:
    manifest = bundle.manifest
    return Offer(
        name=bundle.name,
        environment=manifest.task,
        channel=manifest.channel,
        tokens=bundle.lexicon.tokens,
        budget=float(manifest.budget),
    )
