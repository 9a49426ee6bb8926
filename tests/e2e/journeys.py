"""Studies that have everything, for the walk through the whole journey: quiz, checks, questionnaires, probe, pay.

The German and the Arabic one say the same in fewer forms; what they are for is long words and the other direction.
"""

from typing import Any

TLX = [
    ("mental", "Mental demand: How mentally demanding was the task?", "Very low", "Very high"),
    ("physical", "Physical demand: How physically demanding was the task?", "Very low", "Very high"),
    (
        "temporal",
        "Temporal demand: How hurried or rushed was the pace of the task?",
        "Very low",
        "Very high",
    ),
    (
        "performance",
        "Performance: How successful were you in accomplishing what you were asked to do?",
        "Perfect",
        "Failure",
    ),
    (
        "effort",
        "Effort: How hard did you have to work to accomplish your level of performance?",
        "Very low",
        "Very high",
    ),
    (
        "frustration",
        "Frustration: How insecure, discouraged, irritated, stressed, and annoyed were you?",
        "Very low",
        "Very high",
    ),
]


def scale(key: str, text: str, low: str, high: str) -> dict[str, Any]:
    return {"key": key, "kind": "scale", "text": text, "low": low, "high": high}


def choice(key: str, text: str, *options: str, **more: Any) -> dict[str, Any]:
    return {"key": key, "text": text, "options": options, **more}


PERSON = {
    "key": "person",
    "title": "About you",
    "lead": "These questions describe who took part. You may leave the last one out.",
    "items": [
        {"key": "age", "kind": "number", "text": "How old are you?", "minimum": 18, "maximum": 99},
        choice(
            "games",
            "How often do you play computer games?",
            "Never",
            "Some times a month",
            "Every week",
            "Daily",
        ),
        {"key": "idea", "kind": "text", "text": "What helped you in the game?", "required": False},
    ],
}
PAY = {
    "currency": "GBP",
    "reward_minor": 300,
    "partial_minor": 50,
    "screen_out_minor": 20,
    "bonus_success_minor": 10,
    "bonus_max_minor": 200,
    "cap_participant_minor": 600,
    "cap_study_minor": 100_000,
}
CODES = {"screened_out": "NOT-THIS-TIME", "withdrawn": "LEFT-EARLY"}
PROLIFIC = "https://app.prolific.com/submissions/complete?cc={code}"
EVERYTHING: dict[str, Any] = {
    "questionnaires": [
        {
            "key": "tlx",
            "title": "How was the game for you?",
            "lead": "Choose on each line where it fits best. There are no right answers.",
            "items": [scale(*each) for each in TLX],
        },
        PERSON,
    ],
    "pay": PAY,
    "codes": CODES,
    "completion_url": PROLIFIC,
}

WHOLE: dict[str, tuple[str, dict[str, Any]]] = {
    "whole-parent-child": (
        "parent-child",
        {
            **EVERYTHING,
            "trials_per_block": 1,
            "step_limit": 4,
            "token_probe": True,
            "quiz": [
                choice(
                    "see",
                    "Which squares can you see?",
                    "Only those next to me",
                    "The whole board",
                    answer=1,
                    role="parent",
                ),
                choice(
                    "say",
                    "How many signs can you send in a round?",
                    "As many as I like",
                    "One",
                    answer=2,
                    role="child",
                ),
                choice("time", "Is there a time limit?", "Yes, ten seconds", "No", answer=2),
            ],
            "attention": [
                choice(
                    "colour",
                    "Please choose “Green”, so that we know that you read this.",
                    "Red",
                    "Green",
                    "Blue",
                    answer=2,
                    after=1,
                )
            ],
        },
    ),
    "whole-traffic": (
        "traffic-junction",
        {
            **EVERYTHING,
            "trials_per_block": 2,
            "step_limit": 20,
            "quiz_tries": 2,
            "quiz": [
                choice("brake", "Which key brakes?", "F", "J", "The space bar", answer=1),
                choice(
                    "triangle",
                    "What does a large, dark triangle say?",
                    "A car is likely to be there",
                    "The road is closed there",
                    answer=1,
                ),
            ],
        },
    ),
}

GERMAN_TEXTS = {
    "language": "de",
    "welcome": "Sie steuern ein Auto über eine Kreuzung. Wir möchten verstehen, wie Menschen und Computer einander verstehen.",
    "consent_version": "de-1",
    "consent": [
        "Was Sie tun: Sie lesen eine kurze Anleitung und spielen einige Runden mit zwei Tasten. Sie können jederzeit aufhören.",
        "Was wir aufzeichnen: Ihre Tastendrücke und Ihre Reaktionszeiten. Die Datenschutzgrundverordnung und die Einwilligungserklärungsaufbewahrungsfristen werden eingehalten.",
        "Aufwandsentschädigungsauszahlung: Sie erhalten den genannten Betrag über die Rekrutierungsplattform.",
    ],
    "agree": "Ich bin mindestens 18 Jahre alt, habe diese Einverständniserklärungsseite gelesen und nehme freiwillig teil.",
    "instructions": [
        "Denken Sie an die Geschwindigkeitsbegrenzungsvorschriften des Straßenverkehrsordnungswidrigkeitenrechts.",
    ],
    "declined": "Sie nehmen nicht teil. Über Sie wurde nichts gespeichert.",
    "complete": "Vielen Dank. Alles ist sicher angekommen.",
}
GERMAN_QUIZ = [
    choice(
        "taste",
        "Mit welcher Taste leiten Sie die Geschwindigkeitsverringerungsmaßnahmen ein?",
        "Mit der Taste F, die auch als Bremsbetätigungseinrichtungstaste bezeichnet wird",
        "Mit der Taste J",
        answer=1,
    )
]
ARABIC_TEXTS = {
    "language": "ar",
    "direction": "rtl",
    "welcome": "ستقود سيارة عبر تقاطع صغير مرة بعد مرة. نريد أن نفهم كيف يفهم الناس والحواسيب بعضهم بعضا.",
    "consent_version": "ar-1",
    "consent": [
        "ماذا ستفعل: تقرأ تعليمات قصيرة وتلعب بضع جولات بمفتاحين. يمكنك التوقف في أي وقت.",
        "ماذا نسجل: المفاتيح التي تضغطها والوقت الذي يستغرقه كل قرار. لا نستخدم كاميرا ولا ميكروفونا.",
        "المشاركة اختيارك. يمكنك التوقف دون ذكر سبب.",
    ],
    "agree": "عمري 18 عاما أو أكثر، وقد قرأت هذه الصفحة، وأشارك بإرادتي.",
    "declined": "اخترت عدم المشاركة. لم نحفظ عنك شيئا.",
    "complete": "شكرا لك. وصل كل شيء بأمان.",
}
ARABIC_ASKED = {
    "key": "tlx",
    "title": "كيف كانت اللعبة؟",
    "lead": "اختر على كل خط المكان الأنسب.",
    "items": [
        scale("mental", "الجهد الذهني: كم كانت المهمة مجهدة للذهن؟", "منخفض جدا", "مرتفع جدا"),
        scale("effort", "الجهد: كم كان عليك أن تعمل؟", "منخفض جدا", "مرتفع جدا"),
    ],
}
SHORT_TRAFFIC = {
    "trials_per_block": 1,
    "step_limit": 20,
    "pay": PAY,
    "codes": CODES,
    "completion_url": PROLIFIC,
}
WHOLE["deutsch"] = (
    "traffic-junction",
    {
        **SHORT_TRAFFIC,
        "title": "Kreuzungsüberquerungsgeschicklichkeitsspiel",
        "texts": GERMAN_TEXTS,
        "quiz": GERMAN_QUIZ,
    },
)
WHOLE["arabic"] = (
    "traffic-junction",
    {
        **SHORT_TRAFFIC,
        "title": "عبور التقاطع",
        "texts": ARABIC_TEXTS,
        "questionnaires": [ARABIC_ASKED],
    },
)
