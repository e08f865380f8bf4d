/* Which blocks of a library compiled with -fsanitize-coverage=trace-pc have run: preloaded, it gives what such code calls. */

#include <stdint.h>

enum { SLOTS = 1 << 18, PROBES = 64 };

static uintptr_t seen[SLOTS];

void __sanitizer_cov_trace_pc(void) {
    uintptr_t place = (uintptr_t)__builtin_return_address(0);
    uintptr_t slot = (place * 0x9E3779B97F4A7C15u) >> 46;
    for (int probe = 0; probe < PROBES; probe++, slot = (slot + 1) % SLOTS) {
        if (seen[slot] == place) {
            return;
        }
        if (!seen[slot]) {
            seen[slot] = place;
            return;
        }
    }
}

/* The places since the last call, at most SLOTS; how many. */
int blocks_taken(uintptr_t *places) {
    int count = 0;
    for (int slot = 0; slot < SLOTS; slot++) {
        if (seen[slot]) {
            places[count++] = seen[slot];
            seen[slot] = 0;
        }
    }
    return count;
}
