/* trust.c - an announcement is checked by the host's own function.
 *
 *     trust PUBLIC.json VERDICT
 *
 * Purpose: what is given to the host is the signed message, and its verdict counts. Prints the
 * status, the message's SHA-256 and the explanation. A failure suggests another spelling (E16). */
#include "cuecast.h"
#include "proofs.h"

#include <stdio.h>
#include <stdlib.h>

static uint8_t digest[32];

static int verify(void *context, const uint8_t signature[64], const uint8_t key[32],
                  const uint8_t *message, size_t bytes) {
    (void)signature;
    (void)key;
    cue_sha256(message, bytes, digest);
    return *(const int *)context;
}

int main(int argc, char **argv) {
    static unsigned char file[1 << 16];
    char text[512] = "";
    if (argc != 3) return 3;
    FILE *in = fopen(argv[1], "rb");
    size_t bytes = in ? fread(file, 1, sizeof file, in) : 0;
    int verdict = atoi(argv[2]);
    cue_config config = cue_default_config(48000, 2);
    cue_state *cue = malloc(cue_size(&config));
    if (!cue || cue_init(cue, cue_size(&config), &config) != CUE_OK) return 3;
    cue_status status = cue_trust(cue, file, bytes, 10.0, verify, &verdict);
    if (status != CUE_OK && cue_explain(cue, text, sizeof text) != CUE_OK) return 3;
    printf("{\"status\":%d,\"text\":\"%s\",\"message\":\"", (int)status, text);
    for (int i = 0; i < 32; i++) printf("%02x", digest[i]);
    printf("\"}\n");
    free(cue);
    return 0;
}
