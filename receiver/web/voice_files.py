"""The files that the player needs of a voice: as televisions serve them, as devices read them."""

import json
from pathlib import Path

from codec.cuer.voice import Voice
from receiver.drawing.avatar import has_avatar
from receiver.drawing.voice_document import avatar_documents, voice_document
from receiver.export.device_voice import device_voice


def write_voice(folder: Path, voice: Voice) -> None:
    """Write the player's files of a voice: `voice.bin`, `voice.json` and the avatar's.

    `avatar.bin` is the first look; `avatar-NAME.bin` are the others.
    """
    (folder / "voice.bin").write_bytes(device_voice(voice))
    text = json.dumps(voice_document(voice), ensure_ascii=False)
    (folder / "voice.json").write_text(text, encoding="utf-8")
    if has_avatar(voice):
        for name, document in avatar_documents(voice).items():
            (folder / name).write_bytes(document)
