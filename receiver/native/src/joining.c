/* joining.c
 * In: scores or windows of neighbouring superframes, any of them missing. Out: one line of phones,
 * and the keys that follow from it.
 * Source: rules of Cued Speech after Cornett 1967; the chart is data (S11).
 * Specification: spec/bitstream.md, section 4 (J1 to J8). */
#include "payload.h"

enum { NOMINAL = 4, GAP = 6 }; /* J3, J6 */

static void add(cue_line *line, unsigned number, int32_t start, int32_t end, int opens, int ends_open)
{
    if (line->sounds == MOST_LINE) return;
    cue_sound *s = &line->sound[line->sounds++];
    s->number = (uint8_t)number;
    s->start = start;
    s->end = end;
    s->open_start = (uint8_t)opens;
    s->open_end = (uint8_t)ends_open;
    s->stands = 0;
}

static void finish(cue_sound *s, int32_t end) {
    s->end = end;
    s->open_end = 0;
}

static cue_sound *last_of(cue_line *line) {
    return line->sounds ? &line->sound[line->sounds - 1] : 0;
}

/* J3: end the last phone, of which the next superframe was to tell more; `exact` is J8. */
static void complete(cue_line *line, unsigned ahead, int32_t end, int exact) {
    cue_sound *last = last_of(line);
    if (last->number == 0 || (exact && !ahead)) {
        finish(last, end > last->start ? end : last->start);
        return;
    }
    int32_t reach = exact ? cue_floor(last->start + end, 2)
                          : (end > last->start + NOMINAL ? end : last->start + NOMINAL);
    finish(last, reach);
    if (ahead) add(line, ahead, reach, exact ? end : reach + NOMINAL, 0, 0);
}

/* J8: the first phone of a superframe is what the last stand-in of the one before was. */
static void take_stand_in(cue_line *line, unsigned number, int32_t end) {
    if (cue_is_consonant(number) && cue_is_vowel(last_of(line)->number) && line->sounds > 1)
        line->sounds--;
    cue_sound *last = last_of(line);
    if (cue_is_vowel(number) && cue_is_consonant(last->number)) {
        int32_t middle = cue_floor(last->start + end, 2);
        finish(last, middle);
        add(line, number, middle, end, 0, 0);
    } else {
        last->number = (uint8_t)number;
        last->stands = 0;
        finish(last, end);
    }
}

/* J1, J2, J8: what sounds as a superframe begins. */
static void begin(cue_line *line, const cue_score *score, const cue_score *before, int32_t start) {
    cue_sound *last = last_of(line);
    int32_t end = start + score->first_end;
    if (score->kind == 3) {
        if (before && last) complete(line, before->ahead, end, 1);
    } else if (before && before->kind == 3 && last && score->first && last->number) {
        take_stand_in(line, score->first, end);
    } else if (before && last && last->number == score->first && last->start < start) {
        finish(last, end);
    } else {
        if (before && last) finish(last, start - 1 > last->start ? start - 1 : last->start);
        add(line, score->first, start - 1, end, 1, 0);
    }
}

static void join_scores(const cue_scores *scores, cue_line *line) {
    for (int i = 0; i < scores->count; i++) {
        const cue_score *score = scores->score[i];
        int32_t start = TICKS * (scores->first + i);
        if (!score || score->kind == 2) continue;
        cue_sound *last = last_of(line);
        if (last && !last->open_end) add(line, 0, last->end, start - 1, 1, 1); /* lost between */
        const cue_score *before = i ? scores->score[i - 1] : 0;
        const cue_score *after = i + 1 < scores->count ? scores->score[i + 1] : 0;
        if (before && before->kind == 2) before = 0;
        begin(line, score, before, start);
        for (int k = 0; k < score->count; k++)
            add(line, score->number[k], start + score->start[k],
                start + (k + 1 < score->count ? score->start[k + 1] : TICKS), 0, 0);
        for (int k = 1; score->kind == 3 && k <= score->count && k <= line->sounds; k++)
            line->sound[line->sounds - k].stands = 1;
        last = last_of(line);
        if (!last) continue;
        last->open_end = 1;
        if (!after || after->kind == 2) complete(line, score->ahead, start + TICKS, 0);
    }
}

/* J6: what reaches beyond the beginning of the next window ends there, and so on backwards. */
static void squeeze(cue_line *line, int32_t end) {
    for (int k = line->sounds - 1; k >= 0 && line->sound[k].end > end; k--) {
        cue_sound *s = &line->sound[k];
        s->end = end;
        if (s->start > end - 1) s->start = end - 1;
        end = s->start;
    }
}

/* J6, J7 */
static void join_windows(const cue_scores *scores, cue_line *line) {
    int hole = 0, told = -1, seen = 0;
    for (int i = 0; i < scores->count; i++) {
        const cue_score *window = scores->score[i];
        if (!window || window->kind != 2) {
            hole |= seen;
            continue;
        }
        seen = 1;
        if (window->count == 0) continue;
        told = i;
        int32_t base = TICKS * (scores->first + i), start = base + window->first_end;
        squeeze(line, start);
        cue_sound *last = last_of(line);
        if (last && hole) {
            if (cue_is_consonant(last->number)) last->open_end = 1;
            add(line, 0, last->end, start, 1, 1);
        } else if (last && (start - last->end <= GAP ||
                            (cue_is_consonant(last->number) && cue_is_vowel(window->number[0])))) {
            last->end = start;
        } else if (last) {
            add(line, 0, last->end, start, 0, 0);
        }
        int first = line->sounds;
        for (int k = 0; k < window->count; k++)
            add(line, window->number[k], base + window->start[k],
                base + (k + 1 < window->count ? window->start[k + 1] : window->end), 0, 0);
        const cue_score *before = i ? scores->score[i - 1] : 0;
        if ((!before || before->kind != 2) && cue_is_vowel(window->number[0]) &&
            first < line->sounds)
            line->sound[first].open_start = 1;
        hole = 0;
    }
    cue_sound *last = last_of(line);
    const cue_score *after = told + 1 < scores->count ? scores->score[told + 1] : 0;
    if (last && (!after || after->kind != 2) && cue_is_consonant(last->number)) last->open_end = 1;
}

int cue_chart(const cue_sound *sounds, int count, cue_cue *out, int most) {
    int n = 0;
    const cue_sound *waiting = 0;
    for (int i = 0; i < count && n + 1 < most; i++) {
        const cue_sound *s = &sounds[i];
        if (s->number == 0) continue;
        if (waiting && waiting->end == s->start && cue_is_vowel(s->number)) {
            out[n++] = (cue_cue){waiting->start, s->end, (int16_t)(waiting->end - waiting->start), 0,
                                 {waiting->number, s->number}, 1};
            waiting = 0;
            continue;
        }
        if (waiting)
            out[n++] = (cue_cue){waiting->start, waiting->end, 0, 0, {waiting->number, 0}, 1};
        waiting = cue_is_consonant(s->number) ? s : 0;
        if (!waiting) out[n++] = (cue_cue){s->start, s->end, 0, 0, {s->number, 0}, 1};
    }
    if (waiting && n < most)
        out[n++] = (cue_cue){waiting->start, waiting->end, 0, 0, {waiting->number, 0}, 1};
    return n;
}

uint8_t cue_key_number(const cue_cue *cue, const uint8_t cheek[3], const cue_tables *tables) {
    unsigned consonant = cue_is_consonant(cue->phones[0]) ? cue->phones[0] : 0;
    unsigned vowel = consonant ? cue->phones[1] : cue->phones[0];
    unsigned shape = consonant ? tables->shape[consonant] : tables->shape_alone;
    unsigned place = vowel ? tables->placement[vowel] : tables->placement_alone;
    if ((vowel == 16 && cheek[0]) || (vowel == 5 && cheek[1]) || (vowel == 4 && cheek[2]))
        place = 4; /* S9: cheek */
    return (uint8_t)(PLACEMENTS * shape + place);
}

const cue_score *cue_nearest(const cue_scores *scores, int32_t index) {
    const cue_score *best = 0;
    int32_t least = INT32_MAX;
    for (int i = 0; i < scores->count; i++) {
        int32_t away = scores->first + i - index;
        if (away < 0) away = -away;
        if (scores->score[i] && away <= least) {
            best = scores->score[i];
            least = away;
        }
    }
    return best;
}

/* J4: options and replacements of the superframe in which a key starts; J5, J7: certainty. */
static void settle(const cue_scores *scores, const cue_tables *tables, cue_line *line) {
    for (int i = 0; i < line->cues; i++) {
        cue_cue *cue = &line->cue[i];
        int32_t index = cue_floor(cue->start, TICKS), next = cue_floor(cue->start + 1, TICKS);
        const cue_score *near = cue_nearest(scores, index), *own = 0, *heard = 0;
        if (index >= scores->first && index < scores->first + scores->count)
            own = scores->score[index - scores->first];
        if (next >= scores->first && next < scores->first + scores->count)
            heard = scores->score[next - scores->first];
        cue->number = cue_key_number(cue, near->cheek, tables);
        int32_t tick = cue->start - TICKS * index;
        if (own && own->replaced[tick]) cue->number = (uint8_t)(own->replaced[tick] - 1);
        int replaces = 0, repeats = 0;
        for (int t = 0; heard && t < TICKS; t++) replaces |= heard->replaced[t];
        if (i)
            repeats = cue[-1].phones[0] == cue->phones[0] && cue[-1].phones[1] == cue->phones[1];
        for (int k = 0; k < line->sounds; k++) {
            const cue_sound *s = &line->sound[k];
            if (s->start != cue->start || !s->number) continue;
            if (s->open_start && (cue_is_vowel(cue->phones[0]) || replaces || repeats))
                cue->certain = 0;
            if (s->open_end && cue_is_consonant(s->number) && cue->phones[1] == 0)
                cue->certain = 0;
        }
    }
}

void cue_join(const cue_scores *scores, const cue_tables *tables, cue_line *line) {
    int windows = 0, known = 0;
    line->sounds = line->cues = 0;
    for (int i = 0; i < scores->count; i++) {
        known += scores->score[i] != 0;
        windows += scores->score[i] && scores->score[i]->kind == 2;
    }
    if (2 * windows > known)
        join_windows(scores, line);
    else
        join_scores(scores, line);
    line->cues = cue_chart(line->sound, line->sounds, line->cue, MOST_CUES);
    settle(scores, tables, line);
}

void cue_stand_in(const cue_preview *preview, cue_score *out) {
    static const uint8_t consonants[8] = {18, 20, 23, 26, 29, 31, 35, 36}; /* d k s n t l g j */
    static const uint8_t vowels[5] = {1, 6, 9, 12, 14};                    /* a i ɛ ɛ̃ e */
    *out = (cue_score){.kind = 3, .rest_gap = 1, .first_end = TICKS};
    if (preview->count) out->first_end = preview->tick[0];
    for (int i = 0; i < preview->count; i++) {
        int tick = preview->tick[i], symbol = preview->symbol[i];
        int end = i + 1 < preview->count ? preview->tick[i + 1] : TICKS;
        out->number[out->count] = symbol < 40 ? consonants[symbol / 5] : 0;
        out->start[out->count++] = (int16_t)tick;
        if (symbol >= 40) continue;
        int part = 40 * (end - tick) / 100, middle = tick + (part > 1 ? part : 1);
        if (middle < TICKS) {
            out->number[out->count] = vowels[symbol % 5];
            out->start[out->count++] = (int16_t)middle;
        } else {
            out->ahead = vowels[symbol % 5];
        }
    }
}
