"""How a server is connected to Prolific's webhook, at a made-up Prolific over HTTP."""

from collections.abc import Iterator

import pytest
from pydantic import SecretStr

from server.domain.errors import BadInputError, NotReadyError
from server.services.recruiters import prolific_webhook
from server.settings import Settings
from server.simulate.fake_prolific import FakeProlific, running
from server.simulate.fake_prolific_hooks import WORKSPACE, Hooks

KEY = "a-made-up-key"


@pytest.fixture
def hooks() -> Hooks:
    return Hooks(1)


@pytest.fixture
def settings(hooks: Hooks) -> Iterator[Settings]:
    with running(FakeProlific(KEY, hooks=hooks)) as url:
        yield Settings(
            prolific_api=f"{url}/api/v1",
            prolific_token=SecretStr(KEY),
            public_url="https://study.example.org",
        )


@pytest.mark.parametrize("workspace", [None, WORKSPACE])
def test_prolific_is_told_where_the_server_is_and_again_changes_nothing(
    settings: Settings, hooks: Hooks, workspace: str | None
) -> None:
    first = prolific_webhook(settings, workspace)
    assert first == ("https://study.example.org/hooks/prolific", hooks.secret)
    assert prolific_webhook(settings, workspace) == first
    assert [each.target_url for each in hooks.subscriptions.values() if each.is_enabled] == [first[0]]


def test_a_workspace_that_the_account_does_not_have_is_answered_with_those_that_it_has(
    settings: Settings,
) -> None:
    with pytest.raises(BadInputError, match=f"--workspace: {WORKSPACE}"):
        prolific_webhook(settings, "another")


def test_what_prolific_refuses_is_said(settings: Settings) -> None:
    unsafe = settings.model_copy(update={"public_url": "http://study.example.org"})
    with pytest.raises(NotReadyError, match="target_url"):
        prolific_webhook(unsafe, None)


def test_a_wrong_token_is_said_and_not_shown(settings: Settings) -> None:
    wrong = settings.model_copy(update={"prolific_token": SecretStr("quite-another-key")})
    with pytest.raises(NotReadyError) as refused:
        prolific_webhook(wrong, None)
    assert "quite-another-key" not in str(refused.value)
