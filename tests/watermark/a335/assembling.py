"""Messages from their fragments, as any receiver of A/335 puts them together."""

from watermark.a335.messages import Block, checksum


class MessageAssembler:
    """Put fragments together; one message of each form at a time; repeats are dropped."""

    def __init__(self) -> None:
        self._parts: dict[bool, dict[int, Block]] = {False: {}, True: {}}
        self._seen: dict[int, int] = {}

    def add(self, block: Block) -> tuple[int, bytes] | None:
        """Take the next block; return (identifier, message) when it completes a new one."""
        parts = self._parts[block.is_long]
        if any(not _belong_together(block, other) for other in parts.values()):
            parts.clear()
        parts[block.fragment] = block
        if len(parts) <= block.last_fragment:
            return None
        message = b"".join(parts[i].body for i in sorted(parts))
        check = parts[block.last_fragment].message_check
        parts.clear()
        if check is not None:
            data = bytes([block.message_id]) + message
            if check not in (checksum(data, "ieee"), checksum(data, "mpeg")):
                return None
        if self._seen.get(block.message_id) == block.version:
            return None
        self._seen[block.message_id] = block.version
        return block.message_id, message


def _belong_together(a: Block, b: Block) -> bool:
    return (a.message_id, a.version, a.last_fragment) == (b.message_id, b.version, b.last_fragment)
