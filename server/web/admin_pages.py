"""What the admin templates get: one frozen dataclass a page, as in pages.py. Texts and numbers, no rows."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from server.domain.study import StudyDefinition
from server.services.agents import Evaluation, Figure, TokenMeaning
from server.services.monitor import ArmCount, ModeCounts, PersonLine
from server.services.studies import Blank


@dataclass(frozen=True, slots=True)
class Frame:
    """What surrounds every admin page: who is signed in, where they are, the secret of their forms."""

    username: str
    csrf: str
    section: str
    studies: int
    agents: int


@dataclass(frozen=True, slots=True)
class LoginPage:
    template: ClassVar[str] = "admin/login.html"
    csrf: str
    next_url: str
    username: str = ""
    error: str | None = None


@dataclass(frozen=True, slots=True)
class StudyLine:
    """One row of the list."""

    slug: str
    title: str
    task: str
    status: str
    mode: str
    version: str
    arms: int
    places: int
    finished: int
    active: int
    last_activity: str
    last_activity_utc: str


@dataclass(frozen=True, slots=True)
class Filter:
    """One choice above a table."""

    label: str
    url: str
    chosen: bool


@dataclass(frozen=True, slots=True)
class StudiesPage:
    template: ClassVar[str] = "admin/studies.html"
    frame: Frame
    lines: tuple[StudyLine, ...]
    filters: tuple[Filter, ...]
    active: int
    finished_live: int
    places_live: int
    finished_test: int
    bundle_errors: int
    notice: str | None = None


@dataclass(frozen=True, slots=True)
class Form:
    """Values and messages of a form, by the path of the field (`arms.2.budget`)."""

    values: Mapping[str, str] = field(default_factory=dict)
    errors: Mapping[str, str] = field(default_factory=dict)

    def value(self, path: str) -> str:
        return self.values.get(path, "")


@dataclass(frozen=True, slots=True)
class NewStudyPage:
    template: ClassVar[str] = "admin/new.html"
    frame: Frame
    blanks: tuple[Blank, ...]
    studies: tuple[tuple[str, str], ...]
    form: Form


@dataclass(frozen=True, slots=True)
class StudyHead:
    """The head of every page of one study."""

    slug: str
    title: str
    status: str
    mode: str
    tab: str
    version: int | None
    sha256: str
    launched: str
    has_draft: bool


@dataclass(frozen=True, slots=True)
class BundleChoice:
    """A loaded agent that fits the task of the study."""

    name: str
    channel: str
    budget: str
    tokens: int


@dataclass(frozen=True, slots=True)
class Mistake:
    """One line of the summary: where it leads, how the field is called, what is wrong."""

    path: str
    label: str
    message: str


@dataclass(frozen=True, slots=True)
class Step:
    """One step of what a participant goes through."""

    name: str
    amount: str


@dataclass(frozen=True, slots=True)
class EntryLink:
    """A participant link with the placeholders of a marketplace."""

    name: str
    label: str
    url: str
    hint: str


@dataclass(frozen=True, slots=True)
class LaunchedVersion:
    """A frozen version; what stands at `url` has this sha256."""

    number: int
    launched: str
    sha256: str
    url: str


@dataclass(frozen=True, slots=True)
class BuildPage:
    template: ClassVar[str] = "admin/build.html"
    frame: Frame
    head: StudyHead
    task: str
    form: Form
    arms: tuple[int, ...]
    bundles: tuple[BundleChoice, ...]
    communications: tuple[tuple[str, str], ...]
    roles: tuple[str, ...]
    mistakes: tuple[Mistake, ...]
    wrong_sections: frozenset[str]
    base: str
    steps: tuple[Step, ...]
    places: str
    links: tuple[EntryLink, ...]
    versions: tuple[LaunchedVersion, ...]
    saved: bool
    notice: str | None = None


@dataclass(frozen=True, slots=True)
class ConfirmPage:
    """Asks before something that cannot be taken back, or that changes what data mean."""

    template: ClassVar[str] = "admin/confirm.html"
    frame: Frame
    head: StudyHead
    question: str
    consequences: tuple[str, ...]
    action: str
    button: str
    danger: bool
    fields: Mapping[str, str]
    definition: StudyDefinition | None = None


@dataclass(frozen=True, slots=True)
class FlowBox:
    """One box of the diagram: how many came here, and who does not come to the next."""

    label: str
    people: int
    lost: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class FlowArm:
    """The flow within one arm."""

    name: str
    allocated: int
    finished: int
    analysed: int


@dataclass(frozen=True, slots=True)
class MonitorPage:
    template: ClassVar[str] = "admin/monitor.html"
    frame: Frame
    head: StudyHead
    mode: str
    modes: tuple[Filter, ...]
    counts: ModeCounts
    never_entered: int
    """Declined, or the device did not fit."""
    flow: tuple[FlowBox, ...]
    flow_arms: tuple[FlowArm, ...]
    arms: tuple[ArmCount, ...]
    earlier: tuple[ArmCount, ...]
    shows: tuple[Filter, ...]
    people: tuple[PersonLine, ...]
    people_left: int
    links: tuple[EntryLink, ...]
    updated: str
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AgentCard:
    """What an experimenter asks of an agent before people play with it."""

    name: str
    task: str
    channel: str
    budget: str
    tokens: int
    tokens_used: int
    tokens_null: int
    figures: tuple[Figure, ...]
    evaluation: Evaluation
    sha256: str
    url: str


@dataclass(frozen=True, slots=True)
class AgentsPage:
    template: ClassVar[str] = "admin/agents.html"
    frame: Frame
    agents: tuple[AgentCard, ...]
    errors: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AgentPage:
    template: ClassVar[str] = "admin/agent.html"
    frame: Frame
    agent: AgentCard
    facts: tuple[tuple[str, str], ...]
    rows: int
    columns: int
    tokens: tuple[TokenMeaning, ...]


@dataclass(frozen=True, slots=True)
class NoticePage:
    """Any state that is only told, inside the admin."""

    template: ClassVar[str] = "admin/notice.html"
    frame: Frame
    heading: str
    paragraphs: tuple[str, ...]
    back_url: str
    back_label: str


@dataclass(frozen=True, slots=True)
class Choice:
    """A marketplace that can be recruited at; without an account the page says how to connect one."""

    name: str
    label: str
    connected: bool


@dataclass(frozen=True, slots=True)
class MismatchLine:
    key: str
    participant: str
    submission: str
    ours: str
    theirs: str
    says: str
    action: str
    amount: str
    can_do: bool


@dataclass(frozen=True, slots=True)
class LedgerLine:
    when: str
    participant: str
    submission: str
    what: str
    amount: str
    state: str
    by: str
    detail: str


@dataclass(frozen=True, slots=True)
class PostingBox:
    """One posting at a marketplace with everything about it."""

    id: int
    marketplace: str
    external_id: str
    state: str
    mode: str
    places: int
    polled: str
    states: tuple[tuple[str, int], ...]
    mismatches: tuple[MismatchLine, ...]
    to_do: int
    ledger: tuple[LedgerLine, ...]
    ledger_more: int
    spent: str


@dataclass(frozen=True, slots=True)
class RecruitmentPage:
    """Postings of a study and the reconciler; `outcomes` are (done, key, words) of the last confirmation."""

    template: ClassVar[str] = "admin/recruitment.html"
    frame: Frame
    head: StudyHead
    choices: tuple[Choice, ...]
    postings: tuple[PostingBox, ...]
    can_post: bool
    places: int
    values: Mapping[str, str]
    error: str
    outcomes: tuple[tuple[bool, str, str], ...]
    caps: tuple[str, str]
    """Of one participant, and of the study."""
    webhook_url: str
