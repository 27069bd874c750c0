/* range_decoder.c
 * In: bytes of one code, rows of frequencies. Out: symbols, and whether each is determined.
 * Source: Martin 1979; byte-wise carry-free form of Schindler 1998.
 * Specification: spec/bitstream.md, section 7 (R1 to R8). */
#include "payload.h"

static void next_byte(cue_range *r) {
    uint32_t byte = 0, slack = 255;
    if (r->position < r->bytes) {
        byte = r->data[r->position];
        slack = 0;
        if (r->position == r->bytes - 1) {
            byte &= ~r->unknown; /* R8 */
            slack = r->unknown;
        }
    }
    r->code = r->code << 8 | byte;
    r->slack = (r->slack << 8 | slack) & UINT64_C(0xFFFFFFFFFF);
    r->position++;
}

void cue_range_begin(cue_range *r, const uint8_t *data, size_t bytes, unsigned tail_bits) {
    r->data = data;
    r->bytes = bytes > tail_bits / 8 ? bytes - tail_bits / 8 : 0;
    r->unknown = (1U << tail_bits % 8) - 1U;
    r->position = 0;
    r->range = UINT32_MAX;
    r->code = 0;
    r->slack = 0;
    r->determined = 1;
    for (int i = 0; i < 4; i++) next_byte(r);
    if (r->code > UINT32_MAX - 1U) r->code = UINT32_MAX - 1U; /* R2 */
}

unsigned cue_range_symbol(cue_range *r, const uint16_t *row, unsigned n, unsigned limit) {
    uint32_t unit = r->range >> 15, v = r->code / unit, start = 0, size;
    unsigned s = 0, last = limit < n ? limit : n - 1U;
    if (v > 32767) v = 32767;
    while (s < last && v >= start + row[s]) start += row[s++];
    size = s == last || start + row[s] == 32768 ? r->range - unit * start : unit * row[s];
    r->determined = (uint64_t)r->code + r->slack < (uint64_t)unit * start + size;
    r->code -= unit * start;
    r->range = size;
    while (r->range < 1U << 24 && r->range > 0) { /* R4 */
        r->range <<= 8;
        next_byte(r);
    }
    return s;
}

unsigned cue_range_bits(cue_range *r, unsigned count) {
    static const uint16_t even[2] = {HALF, HALF};
    unsigned value = 0;
    while (count-- > 0) value = value << 1 | cue_range_symbol(r, even, 2, 2);
    return value;
}
