"""A link that names nobody: mailing lists, classes, pilots. A cookie brings the same browser back."""

from server.recruitment.arrival import Arrival, ExitLink


def recognise() -> Arrival:
    """An arrival without a name."""
    return Arrival("direct")


def exit_link(code: str, template: str | None) -> ExitLink | None:
    """The study's own link, with `{code}` filled in; none where the study has none."""
    return ExitLink(template.replace("{code}", code)) if template else None
