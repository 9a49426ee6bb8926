"""A robot reads pages as a browser does."""

from server.simulate import pages

CONSENT = """<!doctype html><html><head><title> Find &amp; go </title></head><body class="page wide">
<h1 id="heading">Hello <b>you</b></h1>
<form method="post" action="/s/demo/consent?x=1"><input type="hidden" name="PROLIFIC_PID" value="a&quot;b">
<input name="device"><input type="checkbox" name="read" value="yes"><input type="radio" name="r" value="1">
<input type="radio" name="r" value="2"><button name="agree" value="yes">I agree</button>
<button name="agree" value="no">No</button><button>plain</button></form>
<input name="outside" value="1">
<script type="application/json" id="page-data">{"round_url": "/p/k/round", "html": "<b>"}</script>
</body></html>"""


def test_a_form_is_read_with_hidden_fields_ticks_and_buttons() -> None:
    form = pages.read(CONSENT).form_to("/consent")
    assert form is not None
    assert form.fields == {"PROLIFIC_PID": 'a"b', "device": ""}
    assert form.ticks == {"read": "yes", "r": "1"}
    assert form.buttons == [("agree", "yes"), ("agree", "no")]
    assert form.method == "post"


def test_filling_sets_only_what_the_form_has() -> None:
    form = pages.read(CONSENT).form_to("/consent")
    assert form is not None
    sent = form.filled(agree="yes", device="desktop", viewport="1280x720")
    assert sent == {"PROLIFIC_PID": 'a"b', "device": "desktop", "read": "yes", "r": "1", "agree": "yes"}


def test_a_button_that_is_not_there_cannot_be_pressed() -> None:
    form = pages.read('<form action="/p/k/next"><button name="go" value="1">Go</button></form>').forms[0]
    assert "go" not in form.filled(go="2")


def test_page_data_title_texts_and_body_classes_are_read() -> None:
    page = pages.read(CONSENT)
    assert page.data == {"round_url": "/p/k/round", "html": "<b>"}
    assert page.title == "Find & go"
    assert page.texts["heading"] == "Hello you"
    assert page.classes == {"page", "wide"}
    assert page.form_to("/next") is None


def test_a_page_without_data_has_none() -> None:
    assert pages.read("<p>unclosed <br> text").data is None
