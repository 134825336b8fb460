/* Four ESCs on one pack, 1 ms at a time: zero throttle until they are armed, then half.
 *
 *     cargo run --release -- --speed lockstep --escs 4 --bus 6s
 *     cc -o example emulator/lockstep/example.c && ./example 14600
 */
#define _POSIX_C_SOURCE 200809L

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "siskin.h"

static struct siskin siskin;

/* FNV-1a over all states: equal for every client that sends the same. */
static uint64_t hash = 0xcbf29ce484222325;

static void look(void) {
    for (size_t i = 0; i < siskin.state_len; i++) hash = (hash ^ siskin.state[i]) * 0x100000001b3;
}

static double now_s(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int argc, char **argv) {
    int port = argc > 1 ? atoi(argv[1]) : 14600;
    int steps = argc > 2 ? atoi(argv[2]) : 2000;
    unsigned long answers = 0;
    double gust[SISKIN_ESCS][2];
    for (int i = 0; i < SISKIN_ESCS; i++) gust[i][0] = 0.0, gust[i][1] = 100.0 * i;
    if (siskin_open(&siskin, "127.0.0.1", (uint16_t)port) < 0) {
        perror("siskin");
        return 1;
    }
    double began_s = now_s();
    for (int step = 0; step < steps; step++) {
        if (step == steps / 2) {
            if (siskin_environment(&siskin, NAN, 0.02, 10.0, (const double (*)[2])gust) < 0) {
                perror("siskin");
                return 1;
            }
            look();
        }
        unsigned value = step < 400 ? 0 : 1047;
        for (unsigned esc = 0; esc < siskin.escs; esc++)
            siskin_dshot(&siskin, esc, 10000 * esc, SISKIN_BIDIRECTIONAL_DSHOT600, value);
        if (siskin_advance(&siskin, 1000000) < 0) {
            perror("siskin");
            return 1;
        }
        look();
        struct siskin_answer answer;
        size_t at = 0;
        unsigned nth = 0;
        while (siskin_next(&siskin, &at, &nth, &answer) == 0) answers += answer.datagram[0] == 22;
    }
    double took_s = now_s() - began_s;
    for (unsigned esc = 0; esc < siskin.escs; esc++)
        printf("ESC %u: %.1f rpm, %.3f Nm, %.2f V\n", esc, siskin.esc[esc].rpm, siskin.esc[esc].torque_nm, siskin.esc[esc].bus_v);
    printf("%.3f s simulated, %lu replies, states %016llx\n", 1e-9 * (double)siskin.time_ns, answers, (unsigned long long)hash);
    fprintf(stderr, "%.1f times real time\n", 1e-3 * steps / took_s);
    siskin_close(&siskin);
    return 0;
}
