"""The files that the player needs of a voice: as televisions serve them, as devices read them."""

import json
from pathlib import Path

from codec.cuer.voice import Voice
from receiver.drawing.avatar_document import avatar_documents
from receiver.drawing.voice_document import voice_document
from receiver.export.device_voice import device_voice


def write_voice(folder: Path, voice: Voice, avatar: bytes | None = None) -> None:
    """Write the player's files of a voice: `voice.bin`, `voice.json` and the avatar's.

    `avatar.bin` is the first look; `avatar-NAME.bin` are the others. `avatar`, the document of
    another avatar, replaces them all.
    """
    (folder / "voice.bin").write_bytes(device_voice(voice))
    text = json.dumps(voice_document(voice, own_avatar=avatar is not None), ensure_ascii=False)
    (folder / "voice.json").write_text(text, encoding="utf-8")
    for name, document in avatar_documents(voice, avatar).items():
        (folder / name).write_bytes(document)
