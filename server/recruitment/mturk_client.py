"""The wire to Mechanical Turk: boto3 with bounded retries, all pages of a list, failures as RecruiterError.

boto3 is an optional extra and is imported when a client is made. No key of ours is in an error, a repr or a
log: what MTurk answers is quoted without them, and botocore's debug log, which prints signed headers, is off.
"""

import logging
import re
from collections.abc import Iterator
from typing import Any

from pydantic import SecretStr

from server.recruitment.recruiter import RecruiterError

REGION = "us-east-1"  # MTurk has no other
PAGE = 100  # the most that one answer lists
ATTEMPTS = 5
CONNECT_S, READ_S = 5, 30
MISSING = "MTurk needs boto3. In hatlab's folder: .venv/bin/pip install -c constraints.txt -e '.[mturk]'"
KEYS_WRONG = (
    "MTurk does not accept the access key: check HATLAB_MTURK_ACCESS_KEY_ID, HATLAB_MTURK_SECRET_ACCESS_KEY, "
    "HATLAB_MTURK_ENDPOINT and this computer's clock"
)
KEY_CODES = frozenset(
    {
        "AccessDeniedException",
        "ExpiredTokenException",
        "IncompleteSignature",
        "IncompleteSignatureException",
        "InvalidClientTokenId",
        "InvalidSignatureException",
        "MissingAuthenticationToken",
        "MissingAuthenticationTokenException",
        "OptInRequired",
        "SignatureDoesNotMatch",
        "UnrecognizedClientException",
    }
)
BUSY_CODES = frozenset(
    {"RequestLimitExceeded", "ServiceFault", "Throttling", "ThrottlingException", "TooManyRequestsException"}
)
SERVER_FAULT = 500
STAMP = re.compile(r"\s*\(\d{10,}(?: s)?\)\s*$")  # MTurk ends its messages with the time


class RefusedError(RecruiterError):
    """MTurk understood and said no; `code` is its own, like AWS.MechanicalTurk.HITDoesNotExist."""

    def __init__(self, message: str, code: str, *, again: bool = False) -> None:
        super().__init__(message, again=again)
        self.code = code


class MTurkClient:
    """Operations of the requester API by their boto3 names."""

    def __init__(
        self, endpoint: str, access_key_id: SecretStr, secret_access_key: SecretStr, attempts: int = ATTEMPTS
    ) -> None:
        self._secrets = (secret_access_key.get_secret_value(), access_key_id.get_secret_value())
        self._inner = connect(endpoint, *self._secrets, attempts)

    def ask(self, operation: str, **values: Any) -> dict[str, Any]:
        """One request.

        Raises:
            RecruiterError: it failed, after `attempts` tries where trying again helps.
        """
        from botocore.exceptions import BotoCoreError, ClientError, ConnectionError, HTTPClientError  # noqa: A004

        try:
            answer: dict[str, Any] = getattr(self._inner, operation)(**values)
        except ClientError as error:
            failure: RecruiterError = self._refusal(operation, error.response)
        except (ConnectionError, HTTPClientError) as error:
            failure = RecruiterError(f"MTurk cannot be reached: {type(error).__name__}", again=True)
        except BotoCoreError as error:
            failure = RecruiterError(f"{operation}: {self._quoted(str(error))}")
        else:
            return answer
        raise failure  # out here, so that the cause (with its request) does not hang on it

    def every(self, operation: str, member: str, **values: Any) -> Iterator[dict[str, Any]]:
        """The entries of all pages of a list."""
        page = self.ask(operation, MaxResults=PAGE, **values)
        yield from page.get(member, ())
        while mark := page.get("NextToken"):
            page = self.ask(operation, MaxResults=PAGE, NextToken=mark, **values)
            yield from page.get(member, ())

    def close(self) -> None:
        self._inner.close()

    def _refusal(self, operation: str, response: dict[str, Any]) -> RefusedError:
        said = response.get("Error", {})
        kind, code = said.get("Code", ""), response.get("TurkErrorCode", "")
        status = response.get("ResponseMetadata", {}).get("HTTPStatusCode", 0)
        if kind in KEY_CODES:
            return RefusedError(KEYS_WRONG, kind)
        if kind in BUSY_CODES or status >= SERVER_FAULT:
            return RefusedError(f"MTurk is busy ({kind}): try again later", code or kind, again=True)
        return RefusedError(
            f"MTurk refused {operation}: {self._quoted(said.get('Message', kind))}", code or kind
        )

    def _quoted(self, text: str) -> str:
        for secret in self._secrets:
            text = text.replace(secret, "…")
        return STAMP.sub("", " ".join(text.split()))


def connect(endpoint: str, secret_access_key: str, access_key_id: str, attempts: int) -> Any:
    """A boto3 client that knows only what it is given here.

    Raises:
        RecruiterError: boto3 is not installed.
    """
    try:
        import boto3
        from botocore.config import Config
    except ImportError:
        raise RecruiterError(MISSING) from None
    for name in ("boto3", "botocore"):
        logging.getLogger(name).setLevel(logging.INFO)
    return boto3.Session().client(
        "mturk",
        region_name=REGION,
        endpoint_url=endpoint,
        aws_access_key_id=access_key_id,
        aws_secret_access_key=secret_access_key,
        config=Config(
            retries={"mode": "standard", "total_max_attempts": attempts},
            connect_timeout=CONNECT_S,
            read_timeout=READ_S,
        ),
    )
