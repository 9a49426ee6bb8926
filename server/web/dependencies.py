"""What routes ask for, as annotated dependencies. All `async def`: a `def` one would cost a thread hop each.

Transactions are opened inside the routes (`with lab.database.writing() as db`): the block has ended, and the
commit is durable, before the route returns its response. A `yield` dependency commits after it by default.
"""

from typing import Annotated

from fastapi import Depends, HTTPException, Request

from server.services.lab import Lab


async def current_lab(request: Request) -> Lab:
    lab: Lab = request.app.state.lab
    return lab


async def form_fields(request: Request) -> dict[str, str]:
    """The text fields of a posted form; of a repeated one the last.

    Raises:
        HTTPException: 400 for what is no text: a sender may name a charset that decodes to lone surrogates,
            and PostgreSQL stores no null character.
    """
    try:
        form = await request.form(max_files=0, max_fields=200)
        fields = {name: value for name, value in form.multi_items() if isinstance(value, str)}
        "".join((*fields, *fields.values())).encode()
    except UnicodeError as error:
        raise HTTPException(400) from error
    if any("\0" in text for text in (*fields, *fields.values())):
        raise HTTPException(400)
    return fields


CurrentLab = Annotated[Lab, Depends(current_lab)]
Fields = Annotated[dict[str, str], Depends(form_fields)]
