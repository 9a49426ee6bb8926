"""Money: whole minor units (pence, cents) everywhere; here is how people read them."""

SIGNS = {"GBP": "£", "USD": "$", "EUR": "€"}


def shown(minor: int, currency: str) -> str:
    """As people read it.

    >>> shown(150, "GBP")
    '£1.50'
    """
    return f"{SIGNS.get(currency, currency + ' ')}{minor // 100}.{minor % 100:02d}"
