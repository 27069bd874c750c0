/* internal.h - the boundary between the two halves of the receiver.
 *
 * Hearing (resample mdct masking dither acquire align demodulate track polar crc link) turns sound
 * into cue_superframe values. Payload (range_decoder superframe joining motion markers proofs)
 * turns these into events. cuecast.c joins the halves and owns the queue of events.
 *
 * Rules for both: no pointers inside a state, no allocation, no global mutable data, no stdio; every
 * loop has a bound that does not depend on the input; float32 unless a comment says why not.
 */
#ifndef CUE_INTERNAL_H
#define CUE_INTERNAL_H

#include "cuecast.h"

/* ---- Payload half: implemented beside the hearing half ---------------------------------- */

typedef struct cue_payload cue_payload;

/* Bytes of the state, a multiple of 16. It lies inside the caller's block, aligned for double. */
size_t cue_payload_size(const cue_config *config);

/* Prepare the state; no voice is loaded, no broadcaster is trusted. */
cue_status cue_payload_init(cue_payload *payload, const cue_config *config);

/* Drop the timeline; keep voice, tables and trust. */
cue_status cue_payload_reset(cue_payload *payload);

/* Load voice and tables (see cue_voice); trust a broadcaster (see cue_trust); take a clock's time of
 * the sample at time_s (see cue_clock). */
cue_status cue_payload_voice(cue_payload *payload, const void *file, size_t bytes);
cue_status cue_payload_trust(cue_payload *payload, const void *announcement, size_t bytes,
                             double tolerance_s, cue_verify verify, void *context);
void cue_payload_clock(cue_payload *payload, double time_s, double utc_s);

/* Take a superframe. They arrive in order of time, except that those with `late` set (read from
 * sound before the lock) follow a newer one; lost ones have l0_bytes = 0. */
cue_status cue_payload_take(cue_payload *payload, const cue_superframe *superframe);

/* The sound has been heard up to now_s: emit what is final or concealed by then. */
cue_status cue_payload_advance(cue_payload *payload, double now_s);

/* Open a stream file; decode its next superframe (see cue_file_open, cue_file_read). */
cue_status cue_payload_open(cue_payload *payload, const void *file, size_t bytes,
                            cue_file_info *info);
cue_status cue_payload_file_next(cue_payload *payload, const uint8_t *file, size_t bytes);

/* The programme is over: emit the rest. */
cue_status cue_payload_flush(cue_payload *payload);

/* Next event (CUE_OK) or CUE_EMPTY. cuecast.c calls it until CUE_EMPTY only from cue_next: the
 * payload half may compute markers when they are asked for. Never CUE_EVENT_STATE, _SUPERFRAME or
 * _LOST: those come from the hearing half. */
cue_status cue_payload_next(cue_payload *payload, cue_event *event);

/* Fill what a diagnosis says of proofs. */
void cue_payload_diagnose(const cue_payload *payload, cue_diagnosis *diagnosis);

/* Text of a status (explain.c): value, limit, paragraph and likely cause. `detail` is the number
 * that the failing call kept, `rule` the paragraph that a file violates, `diagnosis` how
 * reception stands. */
cue_status cue_explain_text(cue_status status, double detail, const char *rule,
                            const cue_diagnosis *diagnosis, char *text, size_t bytes);

/* Paragraph that the file which was given last violates, "" for none. */
const char *cue_payload_broken(const cue_payload *payload);

#endif
