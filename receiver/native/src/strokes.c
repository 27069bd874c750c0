/* strokes.c
 * In: keys in order of time, the constants of a voice's movement. Out: strokes of the hand, when
 * each leaves and reaches its key, in hundredths of a tick.
 * Source: lead of the hand over the sound after Attina 2005, chapter VI.
 * Specification: spec/bitstream.md, section 5 (P1 to P3, table 5). */
#include "payload.h"

#include <math.h>

static int64_t whole(double x)
{
    return (int64_t)nearbyint(x); /* halves to the even one */
}

static int64_t parts(double seconds)
{
    return whole(5000.0 * seconds);
}

static int64_t least(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

static int64_t most(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

static int64_t free_after(const cue_stroke *s, const double *c)
{
    return s->reach - whole(c[OVERLAP] * (double)(s->reach - s->leave));
}

static cue_stroke to_rest(int64_t end, int64_t before, const double *c)
{
    int64_t leave = end + parts(c[REST_DELAY]);
    int64_t reach = most(least(leave + parts(c[REST_MOVE]), before), leave + parts(c[SHORTEST]));
    return (cue_stroke){leave, reach, 0};
}

/* P2: whether a superframe was lost between two ticks, so that silence is not known. */
static int is_lost(const cue_sound *sounds, int count, int32_t begin, int32_t end)
{
    for (int i = 0; i < count; i++)
        if (sounds[i].open_start && sounds[i].open_end && begin <= sounds[i].start &&
            sounds[i].end <= end)
            return 1;
    return 0;
}

static double way_between(const cue_model *model, unsigned from, unsigned to)
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        double d = (double)model->places[to][k] - (double)model->places[from][k];
        sum += d * d;
    }
    return sqrt(sum);
}

int cue_strokes(const cue_cue *cues, int count, const cue_sound *sounds, int n_sounds,
                unsigned rest_gap, const cue_model *model, cue_stroke *out, int room)
{
    static const int32_t gaps[4] = {12, 25, 50, 90}; /* S9, in ticks */
    const double *c = model->constants;
    const int64_t shortest = parts(c[SHORTEST]), hurried = whole(50.0 * c[HURRIED]);
    const int64_t late_most = parts(c[LATE]), lag_share = whole(100.0 * c[LAG_SHARE]);
    int n = 0;
    out[n++] = (cue_stroke){CUE_LONG_AGO, CUE_LONG_AGO, 0};
    for (int i = 0; i < count && n + 3 <= room; i++) {
        const cue_cue *cue = &cues[i], *before = i ? cue - 1 : 0;
        int64_t a = 100 * (int64_t)cue->start, lead = parts(c[FIRST_LEAD]);
        int rested = !before || (cue->start - before->end >= gaps[rest_gap & 3] &&
                                 !is_lost(sounds, n_sounds, before->end, cue->start));
        if (rested && before) { /* P2, P3 */
            int64_t end = 100 * (int64_t)before->end;
            lead = least(lead, (a - end) / 2);
            out[n++] = to_rest(end, a - lead, c);
        }
        const cue_stroke *last = &out[n - 1];
        double way = way_between(model, last->number, cue->number);
        if (!rested) {
            int64_t d = cue->start - before->start, q = least(d, hurried);
            lead = whole(100.0 * c[LEAD_SHARE]) * q + whole(100.0 * c[CALM_SHARE]) * (d - q);
            lead = least(lead, whole(5000.0 * (c[MOST_LEAD] + c[LEAD_PER_MM] * way)));
            lead = most(lead, parts(c[LEAST_LEAD]));
        }
        int64_t lag = lag_share * cue->consonant;
        int64_t fast = whole(5000.0 * (1.875 / (1000.0 * c[FASTEST])) * way);
        int64_t leave = most(least(a - lead, a + lag - fast), free_after(last, c));
        int64_t late = least(leave + fast, a + lag + late_most);
        out[n++] = (cue_stroke){leave, most(a + lag, most(late, leave + shortest)), cue->number};
    }
    if (count) out[n++] = to_rest(100 * (int64_t)cues[count - 1].end, INT64_C(1) << 40, c);
    for (int g = 1; g < n; g++) {
        out[g].leave = most(out[g].leave, free_after(&out[g - 1], c));
        out[g].reach = most(out[g].reach, most(out[g].leave + 1, out[g - 1].reach + 1));
    }
    return n;
}
