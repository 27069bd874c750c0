"""A folder for any static web server: programme, player and the voice that it shows.

Programme -> index.html index.css | programme.mp4 | cuecast-player.js ... cuecast.wasm | voice.bin
voice.json avatar.bin: the page plays in any browser that may hear its own site's sound.
"""

import html
import os
import shutil
import tempfile
from pathlib import Path

from codec.authentication.announcement import load_announcement
from codec.cuer.voice import Voice
from codec.errors import CueError
from receiver.web.build import DIST, ENTRIES, WASM
from receiver.web.voice_files import write_voice

SEEN = {".mp4", ".m4v", ".webm", ".mov"}
"""Programmes that browsers show in `<video>`."""

HEARD = {".m4a", ".mp3", ".ogg", ".oga", ".opus", ".flac", ".wav", ".aac"}
"""Programmes that browsers play in `<audio>`."""

_PAGE = """<!doctype html>
<html lang="fr">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="index.css">
<script type="module" src="cuecast-player.js"></script>
<cuecast-player keys{trust}>
<{element} src="{source}" controls playsinline>{track}</{element}>
</cuecast-player>
</html>
"""

_STYLE = """body { margin: 0; background: #07080b; }
cuecast-player { max-width: 177.77vh; margin: auto; }
cuecast-player video { max-height: 100vh; }
"""
"""A file of its own: a site's policy may forbid style sheets within a page."""


def write_folder(
    programme: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    voice: Voice,
    captions: bytes | None = None,
    language: str = "fr",
    *,
    avatar: bytes | None = None,
    public: str | os.PathLike[str] | None = None,
) -> list[str]:
    """Write a folder that any static web server may serve.

    Parameters
    ----------
    programme : str or path
        A marked programme that browsers play.
    folder : str or path
        New, or empty.
    voice : Voice
    captions : bytes, optional
        The programme's text as WebVTT, which the browser shows.
    language : str
        Of that text, a code of BCP 47.
    avatar : bytes, optional
        Document of an avatar that replaces the voice's.
    public : str or path, optional
        A broadcaster's public file: the page says whether the cues are verified as his.

    Returns
    -------
    list of str
        Names of the files.

    Raises
    ------
    CueError
        If browsers do not play such a file, it is missing, the folder holds files, or the public
        file is damaged.
    """
    programme, folder = Path(programme), Path(folder)
    kind = programme.suffix.lower()
    if kind not in SEEN | HEARD:
        known = " ".join(sorted(SEEN | HEARD))
        raise CueError(f"{programme}: browsers do not play {kind or 'this'}; they play {known}")
    if not programme.is_file():
        raise CueError(f"{programme}: no such file")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise CueError(f"{folder}: not an empty folder")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".cuecast-page-") as name:
        made = Path(name) / "page"
        made.mkdir()
        source = f"programme{kind}"
        shutil.copyfile(programme, made / source)
        for file in (*ENTRIES, WASM.name):
            shutil.copyfile(DIST / file, made / file)
        write_voice(made, voice, avatar)
        element = "video" if kind in SEEN else "audio"
        title = html.escape(programme.stem)
        track = ""
        if captions is not None:
            (made / "captions.vtt").write_bytes(captions)
            track = f'<track src="captions.vtt" srclang="{html.escape(language)}" default>'
        trust = ""
        if public is not None:
            load_announcement(public)
            shutil.copyfile(public, made / "broadcaster.pub")
            trust = ' trust="broadcaster.pub"'
        text = _PAGE.format(title=title, element=element, source=source, track=track, trust=trust)
        (made / "index.html").write_text(text, encoding="utf-8")
        (made / "index.css").write_text(_STYLE, encoding="utf-8")
        if folder.exists():
            folder.rmdir()
        made.rename(folder)
    return sorted(path.name for path in folder.iterdir())
