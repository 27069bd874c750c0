"""Figures of a playout, and their form for Prometheus."""

from collections.abc import Mapping

from cuecast.live.readiness import STATES

HELP = {
    "packets_total": ("counter", "Packets of the transport stream that came in."),
    "packets_lost_total": ("counter", "Holes in the counter of the sound's packets."),
    "garbage_bytes_total": ("counter", "Bytes that were no packets."),
    "datagrams_dropped_total": ("counter", "Datagrams that the playout was too slow for."),
    "bytes_out_total": ("counter", "Bytes that went out."),
    "marked_seconds_total": ("counter", "Sound that went out marked."),
    "bypass_seconds_total": ("counter", "Sound that went out as it was."),
    "bypasses_total": ("counter", "Changes from marked sound to bypass."),
    "stale_packets_total": ("counter", "Marked packets that came too late."),
    "restarts_total": ("counter", "Marking processes that ended or were given up."),
    "takeovers_total": ("counter", "Times that the process which stood by took over."),
    "successions_total": ("counter", "Times that a playout went on in place of one that ended."),
    "successor_stands_by": ("gauge", "1 while a second playout could go on in place of this one."),
    "stands_by": ("gauge", "1 while a second process could take over."),
    "eased_total": ("counter", "Times that a busy machine led to marking without rehearsal."),
    "eased": ("gauge", "1 while marks are not tried on a coder because the machine is busy."),
    "joint_seconds_total": ("counter", "Sound coded again without a mark, up to a superframe."),
    "input_losses_total": ("counter", "Times that nothing came in for two seconds."),
    "superframes_total": ("counter", "Superframes that were written."),
    "damaged_frames_total": ("counter", "Frames of the sound that could not be decoded."),
    "captions_total": ("counter", "Pieces of live text that are cued."),
    "captions_left_out_total": ("counter", "Pieces of live text that came too late."),
    "captions_refused_total": ("counter", "Pieces of live text over the rate, or not allowed."),
    "state_changes_total": ("counter", "Changes of state, those that the log sums up included."),
    "cuer_lag_seconds": ("gauge", "How far the cuer is behind the live text."),
    "poses_total": ("counter", "Frames of a live interpreter that came."),
    "keys_recognised_total": ("counter", "Keys that a live interpreter showed."),
    "read_back_sent_total": ("counter", "Superframes that went out whole, up to 12 s ago."),
    "read_back_received_total": ("counter", "Those that the playout's own receiver received."),
    "read_back_share": ("gauge", "Share received in the last minute."),
    "read_back_alarms_total": ("counter", "Minutes in which less than 98 % were received."),
    "delay_seconds": ("gauge", "From in to out, as stated."),
    "late_seconds": ("gauge", "How much later than due the last packet went out."),
    "marking": ("gauge", "1 while the sound that goes out is marked."),
    "held_bytes": ("gauge", "Bytes that wait for their time."),
}
"""Kind and meaning of each figure."""


def prometheus(figures: Mapping[str, float], state: str) -> str:
    """Return figures and a state in Prometheus' text format, version 0.0.4."""
    lines = ["# HELP cuecast_state 1 for the present state.", "# TYPE cuecast_state gauge"]
    lines += [f'cuecast_state{{state="{one}"}} {float(one == state)!r}' for one in STATES]
    for name, (kind, text) in HELP.items():
        lines += [f"# HELP cuecast_{name} {text}", f"# TYPE cuecast_{name} {kind}"]
        lines.append(f"cuecast_{name} {float(figures[name])!r}")
    return "\n".join(lines) + "\n"
