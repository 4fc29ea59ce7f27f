/* The examples of docs/c.md as they stand there, with what they take for granted. C11. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <quell.h>

enum { w = 24, h = 16 };

static float color[3 * w * h], motion[4 * w * h], depth[w * h], normal[3 * w * h], x, y, z = 3.0f, result[3 * w * h];
static uint16_t albedo[3 * w * h], matte[3 * w * h];
static const float clip_from_world[16] = {1.5f, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, -1, 0, 0, 0.1f, 0};
static quell_target target = {.struct_size = sizeof target, .data = result, .type = QUELL_F32, .channels = 3};
static char text[512];
static int came, *user = &came;

static int ready(void *count, const quell_clean *clean) {
    ++*(int *)count;
    return quell_clean_read(clean, "color", &target) != QUELL_OK;
}

#include "examples.h"

/* Light of one everywhere comes out as it was. */
static int has_result(const char *what) {
    for (int i = 0; i < 3 * w * h; ++i) {
        if (result[i] < 0.99f || result[i] > 1.01f) {
            fprintf(stderr, "FAILED: %s: %g\n", what, result[i]);
            return 0;
        }
    }
    memset(result, 0, sizeof result);
    return 1;
}

int main(void) {
    for (int i = 0; i < 3 * w * h; ++i) {
        color[i] = 1.0f;
        matte[i] = albedo[i] = 0x3c00;
        normal[i] = i % 3 == 2 ? 1.0f : 0.0f;
    }
    for (int i = 0; i < w * h; ++i) depth[i] = 3.0f;
    example_1();
    const int sequence = has_result("the sequence filter") && came == 1;
    example_2();
    const int realtime = has_result("the real-time filter");
    if (sequence && realtime) puts("the examples of docs/c.md run");
    return !(sequence && realtime);
}
