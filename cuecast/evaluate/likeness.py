"""How alike a marked film and its original are."""

import importlib
import json
import subprocess
import tempfile
from pathlib import Path

from receiver.media.picture import read_lumas
from watermark.quality.picture import PictureMeter, PictureQuality


def compare(original: Path, marked: Path, depth: int) -> PictureQuality:
    """Measure PSNR, SSIM and flicker of a film with luma of `depth` bits."""
    meter = PictureMeter(depth)
    for (_, before), (_, after) in zip(read_lumas(original), read_lumas(marked), strict=True):
        meter.process(before, after)
    return meter.result()


def vmaf(original: Path, marked: Path) -> float | None:
    """Mean VMAF of a film against its original; None without imageio-ffmpeg's FFmpeg."""
    try:
        imageio_ffmpeg = importlib.import_module("imageio_ffmpeg")
    except ImportError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "vmaf.json"
        comparison = f"libvmaf=log_fmt=json:log_path={report}"
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-nostdin", "-v", "error", "-i", str(marked)]
        command += ["-i", str(original), "-lavfi", comparison, "-f", "null", "-"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            return None
        return float(json.loads(report.read_text())["pooled_metrics"]["vmaf"]["mean"])
