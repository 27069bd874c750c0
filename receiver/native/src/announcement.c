/* announcement.c
 * In: a broadcaster's public file, JSON. Out: what a receiver that trusts him has to know, if the
 * signature is right.
 * Source: RFC 8259, RFC 8032; the equation of Ed25519 by Monocypher, or all of it by the host.
 * Specification: spec/authentication.md, section 5 (E15, E16, E18). */
#include "proofs.h"

#include <string.h>

#ifndef CUE_NO_ED25519
#include "monocypher.h"
#endif

enum { MOST_NAME = 80, MOST_SIGNED = 12 * MOST_NAME + 22 * MOST_PERIODS + 400 };

typedef struct text {
    char *at;
    size_t bytes, room;
} text;

/* What is read: `bad` once it is no JSON of this kind; `others`: members that are not E15's. */
typedef struct json {
    const char *at, *end;
    int bad, others;
} json;

static void append(text *out, const char *words, size_t count) {
    if (count > out->room - out->bytes) count = out->room - out->bytes;
    memcpy(out->at + out->bytes, words, count);
    out->bytes += count;
}

static void blanks(json *j) {
    while (j->at < j->end && (*j->at == ' ' || *j->at == '\n' || *j->at == '\r' || *j->at == '\t'))
        j->at++;
}

static int next_is(json *j, char wanted) {
    blanks(j);
    if (j->at == j->end || *j->at != wanted) return 0;
    j->at++;
    return 1;
}

static void must(json *j, char wanted) {
    if (!next_is(j, wanted)) j->bad = 1;
}

static unsigned hex4(json *j) {
    unsigned value = 0;
    for (int i = 0; i < 4; i++, j->at++) {
        int c = j->at < j->end ? *j->at : 0;
        int digit = c >= '0' && c <= '9' ? c - '0'
                    : (c | 32) >= 'a' && (c | 32) <= 'f' ? (c | 32) - 'a' + 10 : -1;
        if (digit < 0) {
            j->bad = 1;
            return 0;
        }
        value = value << 4 | (unsigned)digit;
    }
    return value;
}

static void append_unit(text *out, unsigned unit) {
    static const char digits[] = "0123456789abcdef";
    const char word[6] = {'\\', 'u', digits[unit >> 12 & 15], digits[unit >> 8 & 15],
                          digits[unit >> 4 & 15], digits[unit & 15]};
    append(out, word, 6);
}

/* E16: a character as it is signed. */
static void append_letter(text *out, unsigned letter) {
    static const char plain[] = "\"\\\b\f\n\r\t", named[] = "\"\\bfnrt";
    const char *known = letter && letter < 128 ? strchr(plain, (int)letter) : 0;
    char c = (char)letter;
    if (known) {
        append(out, "\\", 1);
        append(out, named + (known - plain), 1);
    } else if (letter >= 32 && letter < 127) {
        append(out, &c, 1);
    } else if (letter < 0x10000) {
        append_unit(out, letter);
    } else {
        append_unit(out, 0xD800 + ((letter - 0x10000) >> 10));
        append_unit(out, 0xDC00 + ((letter - 0x10000) & 1023));
    }
}

/* A string, in the spelling that is signed. */
static void read_string(json *j, text *out) {
    static const char named[] = "\"\\/bfnrt", plain[] = "\"\\/\b\f\n\r\t";
    must(j, '"');
    while (!j->bad && j->at < j->end && *j->at != '"') {
        unsigned char c = (unsigned char)*j->at++;
        if (c == '\\' && j->at < j->end && *j->at == 'u') {
            j->at++;
            unsigned unit = hex4(j);
            if (unit < 128) append_letter(out, unit);
            else append_unit(out, unit);
        } else if (c == '\\') {
            const char *known = j->at < j->end && *j->at ? strchr(named, *j->at++) : 0;
            if (known) append_letter(out, (unsigned char)plain[known - named]);
            else j->bad = 1;
        } else if (c < 128) {
            append_letter(out, c);
        } else { /* UTF-8 */
            int more = c >= 0xF0 ? 3 : c >= 0xE0 ? 2 : 1;
            unsigned letter = c & (63U >> more);
            for (; more > 0 && j->at < j->end; more--)
                letter = letter << 6 | ((unsigned char)*j->at++ & 63U);
            append_letter(out, letter);
        }
    }
    must(j, '"');
}

static int64_t read_number(json *j) {
    int64_t value = 0;
    blanks(j);
    const char *begin = j->at;
    for (; j->at < j->end && *j->at >= '0' && *j->at <= '9' && value < INT64_C(1) << 40; j->at++)
        value = 10 * value + (*j->at - '0');
    if (j->at == begin) j->bad = 1;
    return value;
}

/* Bytes of base64; the number of them, or -1. */
static int bytes_of(const text *in, uint8_t *out, size_t room) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    size_t n = 0, count = in->bytes;
    uint32_t bits = 0;
    if (count % 4) return -1;
    while (count && in->at[count - 1] == '=' && in->bytes - count < 2) count--;
    for (size_t i = 0; i < count; i++) {
        const char *found = in->at[i] ? strchr(digits, in->at[i]) : 0;
        if (!found) return -1;
        bits = bits << 6 | (uint32_t)(found - digits);
        if (i % 4 == 0) continue;
        if (n == room) return -1;
        out[n++] = (uint8_t)(bits >> (6 - 2 * (i % 4)));
    }
    return (int)n;
}

/* The members as they are signed, in their order: E16. */
enum { ENDS_2, ENDS_9, FIRST, FORMAT, KIND, NAME, KEY, UNTIL, SIGNATURE, MEMBERS };
static const char *const NAMES[MEMBERS] = {"2",    "9",          "first", "format",   "kind",
                                           "name", "public_key", "until", "signature"};

static void read_members(json *j, int outer, text found[MEMBERS]) {
    char name[16], nothing[1];
    must(j, '{');
    do {
        text word = {name, 0, sizeof name - 1};
        read_string(j, &word);
        name[word.bytes] = 0;
        must(j, ':');
        int member = 0;
        while (member < MEMBERS && strcmp(name, NAMES[member]) != 0) member++;
        if (outer && !strcmp(name, "ends")) {
            read_members(j, 0, found);
        } else if (member == MEMBERS || outer != (member > ENDS_9) || found[member].bytes) {
            text skipped = {nothing, 0, 0};
            j->others = 1;
            blanks(j);
            if (j->at < j->end && *j->at == '"') read_string(j, &skipped);
            else (void)read_number(j);
        } else if (member == FIRST || member == UNTIL) {
            blanks(j);
            const char *begin = j->at;
            (void)read_number(j);
            append(&found[member], begin, (size_t)(j->at - begin));
        } else {
            read_string(j, &found[member]);
        }
    } while (!j->bad && next_is(j, ','));
    must(j, '}');
}

static size_t write_signed(const text found[MEMBERS], char *out, size_t room) {
    text all = {out, 0, room};
    append(&all, "{\"ends\":{", 9);
    for (int i = 0; i < SIGNATURE; i++) {
        int quoted = i != FIRST && i != UNTIL;
        append(&all, "\"", 1);
        append(&all, NAMES[i], strlen(NAMES[i]));
        append(&all, quoted ? "\":\"" : "\":", quoted ? 3 : 2);
        append(&all, found[i].at, found[i].bytes);
        append(&all, "\"}", (size_t)quoted + (i == ENDS_9));
        append(&all, i == UNTIL ? "}" : ",", 1);
    }
    return all.bytes;
}

#ifndef CUE_NO_ED25519
static int own_verify(const uint8_t signature[64], const uint8_t key[32], const uint8_t *message,
                      size_t bytes) {
    uint8_t digest[64], h[32];
    cue_sha512 s;
    cue_sha512_begin(&s);
    cue_sha512_add(&s, signature, 32);
    cue_sha512_add(&s, key, 32);
    cue_sha512_add(&s, message, bytes);
    cue_sha512_end(&s, digest);
    crypto_eddsa_reduce(h, digest);
    return crypto_eddsa_check_equation(signature, key, h) == 0;
}
#endif

static int is_text(const text *found, const char *wanted) {
    return found->bytes == strlen(wanted) && memcmp(found->at, wanted, found->bytes) == 0;
}

cue_trusted cue_announcement_read(const void *file, size_t bytes, cue_verify verify, void *context,
                                  cue_announcement *out) {
    static const size_t rooms[MEMBERS] = {11 * MOST_PERIODS + 1, 11 * MOST_PERIODS + 1, 12, 16, 8,
                                          12 * MOST_NAME, 48, 12, 96};
    char room[MOST_SIGNED], message[MOST_SIGNED + 200];
    uint8_t signature[64];
    text found[MEMBERS];
    json j = {file, (const char *)file + bytes, 0, 0};
    char *next = room;
    for (int i = 0; i < MEMBERS; next += rooms[i++]) found[i] = (text){next, 0, rooms[i]};
    read_members(&j, 1, found);
    blanks(&j);
    if (!j.bad && is_text(&found[FORMAT], "cuecast-key-1")) return TRUST_FIRST_EDITION;
    if (j.bad || j.others || j.at != j.end || !is_text(&found[FORMAT], "cuecast-key-3") ||
        !is_text(&found[KIND], "public") || found[NAME].bytes == 0)
        return TRUST_MALFORMED;
    json first = {found[FIRST].at, found[FIRST].at + found[FIRST].bytes, 0, 0};
    json until = {found[UNTIL].at, found[UNTIL].at + found[UNTIL].bytes, 0, 0};
    out->first = read_number(&first);
    out->until = read_number(&until);
    int64_t from = out->first / PERIOD, periods = (out->until + PERIOD - 1) / PERIOD - from;
    if (first.bad || until.bad || out->first >= out->until || from + periods > MOST_PERIODS ||
        bytes_of(&found[KEY], out->key, 32) != 32 || bytes_of(&found[SIGNATURE], signature, 64) != 64)
        return TRUST_MALFORMED;
    for (int w = 0; w < 2; w++)
        if (bytes_of(&found[ENDS_2 + w], out->ends[w][0], sizeof out->ends[w]) != 8 * periods)
            return TRUST_MALFORMED;
    size_t count = write_signed(found, message, sizeof message);
    const uint8_t *data = (const uint8_t *)message;
#ifndef CUE_NO_ED25519
    if (!verify) return own_verify(signature, out->key, data, count) ? TRUST_FINE : TRUST_SIGNATURE;
#endif
    return verify && verify(context, signature, out->key, data, count) ? TRUST_FINE
                                                                       : TRUST_SIGNATURE;
}
