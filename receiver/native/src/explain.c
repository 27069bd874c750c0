/* explain.c
 * In: a status with the number that its call kept, or how reception stands. Out: English text of
 * value, limit, paragraph and likely cause.
 * Source: the manner of errors is that of SMPTE's VC-2 conformance tools.
 * Specification: spec/audio-carrier.md (W35, W39), spec/bitstream.md (H2, H5, H6). */
#include "payload.h"

#include <math.h>
#include <string.h>

typedef struct writer {
    char *text;
    size_t bytes, at;
} writer;

static void say(writer *w, const char *words) {
    while (*words && w->at + 1 < w->bytes) w->text[w->at++] = *words++;
    w->text[w->at] = 0;
}

/* A number with so many digits behind the point. */
static void count(writer *w, double value, int digits) {
    char reversed[32], out[40];
    int n = 0, at = 0;
    if (!(fabs(value) < 1e12)) {
        say(w, "out of range");
        return;
    }
    double scaled = fabs(value);
    for (int i = 0; i < digits; i++) scaled *= 10.0;
    uint64_t whole = (uint64_t)(scaled + 0.5);
    do {
        if (n == digits && digits) reversed[n++] = '.';
        reversed[n++] = (char)('0' + whole % 10);
        whole /= 10;
    } while (whole || n <= digits);
    if (value < 0) out[at++] = '-';
    while (n) out[at++] = reversed[--n];
    out[at] = 0;
    say(w, out);
}

static void say_status(writer *w, cue_status status, double detail, const char *rule) {
    switch (status) {
    case CUE_BAD_ARGUMENT:
        say(w, "An argument is outside its limits; the value found is ");
        count(w, detail, 3);
        say(w, ". Rates are 22050 to 96000 Hz, channels 1 to 8, and `size` fields sizeof of their "
               "struct. Likely cause: a header of another version, or a size that was not set.");
        break;
    case CUE_NO_MEMORY:
        say(w, "The block is smaller than cue_size() of this configuration, or not aligned for "
               "double. Likely cause: cue_size() was asked with another configuration.");
        break;
    case CUE_BAD_STATE:
        say(w, "The block was not made by cue_init() of this version, or its sound has ended. "
               "Likely cause: a call after cue_flush(), or sound while a stream file is open; "
               "cue_reset() begins anew.");
        break;
    case CUE_BAD_DATA:
        if (*rule == 'E') {
            say(w, "The announcement violates ");
            say(w, rule);
            say(w, " of spec/authentication.md. E15: it is no such JSON; E16: its signature is not "
                   "that of the key in it; E18: it is of the first edition, ask the broadcaster "
                   "for his new one.");
            break;
        }
        if (*rule) {
            say(w, "The stream file violates ");
            say(w, rule);
            say(w, " of spec/bitstream.md; its length is ");
            count(w, detail, 0);
            say(w, " bytes. F1 to F5 are its head, F6 and F7 lengths and checksum, F10 its score. "
                   "Likely cause: a cut download, or a page in place of the file.");
            break;
        }
        say(w, "The voice file is malformed; its length is ");
        count(w, detail, 0);
        say(w, " bytes. It begins with CUEVOICE, states its own length and ends with its SHA-256. "
               "Likely cause: a cut download, or a page in place of the file. Make it anew by "
               "`cuecast voice export`.");
        break;
    case CUE_NO_VOICE:
        say(w, "The call needs a voice: load one with cue_voice(). A stream file needs the voice "
               "that it was made with.");
        break;
    case CUE_FULL:
        say(w, "More than ");
        count(w, detail, 0);
        say(w, " records waited and some were lost. Likely cause: cue_next() is not called until "
               "CUE_EMPTY after each second of sound.");
        break;
    case CUE_OK:
    case CUE_EMPTY:
        break;
    }
}

/* E24 to E26: how the stream stands, with its age. */
static void say_proofs(writer *w, const cue_diagnosis *d) {
    static const char *const reasons[] = {
        "", "changed on its way (E22)", "from another time (E24)",
        "without a time of arrival: call cue_clock (E24)", "keys are not the broadcaster's (E19)",
        "no proofs arrive", "the announcement does not hold now (E23)",
        "signed cues were replaced by unsigned ones (E26)"};
    if (d->authenticity == CUE_UNSIGNED) say(w, ", unsigned now");
    if (d->proof_reason && d->proof_reason < sizeof reasons / sizeof reasons[0]) {
        say(w, ", ");
        say(w, reasons[d->proof_reason]);
    }
    if (d->proofs + d->forged > 0) {
        say(w, ", age ");
        count(w, (double)d->age_s, 1);
        say(w, " s");
    }
}

static void say_reception(writer *w, const cue_diagnosis *d) {
    static const char *const states[5] = {"Searching", "Locked", "Degraded", "Lost", "Ended"};
    float level = -200.0F;
    for (int c = 0; c < CUE_MOST_CHANNELS; c++)
        if (d->level_dbfs[c] > level) level = d->level_dbfs[c];
    say(w, states[d->state <= CUE_ENDED ? d->state : 0]);
    say(w, " after ");
    count(w, d->heard_s, 1);
    say(w, " s of sound at ");
    count(w, d->rate_hz, 0);
    say(w, " Hz: level ");
    count(w, (double)level, 0);
    say(w, " dBFS, pilots ");
    count(w, (double)d->pilots, 1);
    say(w, " (4.8 needed, W35), superframes ");
    count(w, d->superframes, 0);
    say(w, " received, ");
    count(w, d->failed, 0);
    say(w, " failed, ");
    count(w, d->proofs, 0);
    say(w, " verified, ");
    count(w, d->forged, 0);
    say(w, " forged");
    say_proofs(w, d);
    say(w, ". ");
    if (d->superframes > 0) {
        if (d->failed > d->superframes)
            say(w, "Most superframes fail: the sound was coded at a low rate, mixed with another, "
                   "or is heard through a loudspeaker.");
    } else if (d->heard_s < 2.0) {
        say(w, "A first lock takes 0.7 to 2 s.");
    } else if (level < -80.0F) {
        say(w, "The sound is silent. Likely cause: a muted or protected source; a page hears zeros "
               "of another origin without CORS.");
    } else if (d->pilots < 4.8F) {
        say(w, "No mark is seen. Likely cause: a programme without a cuer, another key (W10), a "
               "played speed beyond 0.2 %, or only one of two channels that cancel the mark.");
    } else {
        say(w, "Pilots are seen, but nothing passes its check (H6, W39). Likely cause: another key "
               "(W10) or heavy coding.");
    }
}

cue_status cue_explain_text(cue_status status, double detail, const char *rule,
                            const cue_diagnosis *diagnosis, char *text, size_t bytes) {
    writer w = {text, bytes, 0};
    if (bytes == 0) return CUE_BAD_ARGUMENT;
    text[0] = 0;
    if (status == CUE_OK || status == CUE_EMPTY)
        say_reception(&w, diagnosis);
    else
        say_status(&w, status, detail, rule);
    return CUE_OK;
}
