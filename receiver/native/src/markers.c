/* markers.c
 * In: the parameters of a frame, a model. Out: 113 positions in mm.
 * Source: rotation vectors after Rodrigues 1840.
 * Specification: spec/voice.md (O4 to O9). */
#include "payload.h"

#include <math.h>

/* O6 */
static void move(double q[3], const double motion[6]) {
    const double *r = motion;
    double n2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], n = sqrt(n2), a = 1.0, b = 0.5;
    if (n > 1e-6) {
        a = cue_sine(n) / n;
        b = (1.0 - cue_cos(n)) / n2;
    }
    double once[3] = {r[1] * q[2] - r[2] * q[1], r[2] * q[0] - r[0] * q[2],
                      r[0] * q[1] - r[1] * q[0]};
    double twice[3] = {r[1] * once[2] - r[2] * once[1], r[2] * once[0] - r[0] * once[2],
                       r[0] * once[1] - r[1] * once[0]};
    for (int k = 0; k < 3; k++) q[k] += a * once[k] + b * twice[k] + motion[3 + k];
}

/* O7 */
static void motion_of(const float mean[6], const float (*directions)[6], const double *parameters,
                      int count, double out[6]) {
    for (int k = 0; k < 6; k++) {
        out[k] = (double)mean[k];
        for (int i = 0; i < count; i++) out[k] += parameters[i] * (double)directions[i][k];
    }
}

void cue_markers_of(const cue_model *m, const double *parameters, double place[][3]) {
    const double *hand = parameters + N_FACE, *head = hand + N_HAND, *arm = head + m->n_head;
    double motion[6], own[6], row[1 + 2 * MOST_ANGLES];
    motion_of(m->face_motion_mean, m->face_motion, head, m->n_head, motion);
    for (int i = 0; i < FACE_MARKERS; i++) { /* O8 */
        double *q = place[i];
        for (int k = 0; k < 3; k++) {
            q[k] = (double)m->face_mean[i][k] - (double)m->face_pivot[k];
            for (int j = 0; j < N_FACE; j++)
                q[k] += parameters[j] * (double)m->face_directions[j][i][k];
        }
        for (int k = 0; k < 6; k++) own[k] = motion[k] * (double)m->face_weights[i][k];
        move(q, own);
        for (int k = 0; k < 3; k++) q[k] += (double)m->face_pivot[k];
    }
    motion_of(m->hand_motion_mean, m->hand_motion, arm, m->n_forearm, motion);
    row[0] = 1.0;
    for (int a = 0; a < m->n_angles; a++) { /* O9 */
        double angle = (double)m->angle_mean[a];
        for (int i = 0; i < N_HAND; i++) angle += hand[i] * (double)m->angle_directions[i][a];
        row[1 + a] = cue_cos(angle);
        row[1 + m->n_angles + a] = cue_sine(angle);
    }
    for (int i = 0; i < HAND_MARKERS; i++) {
        double *q = place[FACE_MARKERS + i];
        for (int k = 0; k < 3; k++) {
            q[k] = 0.0;
            for (int j = 0; j <= 2 * m->n_angles; j++)
                q[k] += row[j] * (double)m->regression[j][i][k];
        }
        move(q, motion);
        for (int k = 0; k < 3; k++) q[k] += (double)m->hand_pivot[k];
    }
}
