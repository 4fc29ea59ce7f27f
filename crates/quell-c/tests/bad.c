/* Bad input of every kind: an error with the argument's name, and the handle goes on. C11. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <quell.h>

enum { WIDTH = 20, HEIGHT = 14, PIXELS = WIDTH * HEIGHT };

static int failures = 0;
static float color[3 * PIXELS], depth[PIXELS], motion[2 * PIXELS];
static unsigned short halves[3 * PIXELS];

static void check(int good, const char *what) {
    if (!good) {
        fprintf(stderr, "FAILED: %s\n", what);
        ++failures;
    }
}

static void refused(const quell_sequence *s, quell_status status, const char *words) {
    char text[512];
    quell_sequence_message(s, text, sizeof text);
    if (status != QUELL_INVALID_ARGUMENT || !strstr(text, words)) {
        fprintf(stderr, "FAILED: status %d, `%s` is not in `%s`\n", status, words, text);
        ++failures;
    }
}

static void fill(int number) {
    srand((unsigned)number);
    for (int i = 0; i < 3 * PIXELS; ++i) color[i] = -logf((float)(rand() % 1000 + 1) / 1001.0f);
    for (int i = 0; i < PIXELS; ++i) depth[i] = 2.0f;
}

static quell_pass pass(const char *name, const void *data, unsigned channels) {
    quell_pass p;
    memset(&p, 0, sizeof p);
    p.struct_size = sizeof p;
    p.name = name;
    p.data = data;
    p.type = QUELL_F32;
    p.channels = channels;
    return p;
}

static quell_frame frame(long long number, const quell_pass *passes, size_t count) {
    quell_frame f;
    memset(&f, 0, sizeof f);
    f.struct_size = sizeof f;
    f.number = number;
    f.width = WIDTH;
    f.height = HEIGHT;
    f.passes = passes;
    f.pass_count = count;
    return f;
}

struct heard {
    long long numbers[32];
    int count, stop_at;
    float sum, noise;
};

static int ready(void *user, const quell_clean *clean) {
    struct heard *heard = user;
    float room[3 * PIXELS], error[PIXELS];
    quell_target target;
    unsigned channels = 0;
    heard->numbers[heard->count++] = quell_clean_number(clean);
    memset(&target, 0, sizeof target);
    target.struct_size = sizeof target;
    target.data = room;
    target.type = QUELL_F32;
    target.channels = 3;
    check(strcmp(quell_clean_pass(clean, 0, &channels), "color") == 0 && channels == 3, "the filtered pass");
    check(quell_clean_pass(clean, 1, NULL) == NULL, "no pass behind the last");
    check(quell_clean_read(clean, "color", &target) == QUELL_OK, "it is read");
    for (int i = 0; i < 3 * PIXELS; ++i) {
        check(isfinite(room[i]), "a number");
        heard->sum += room[i];
    }
    target.data = error;
    target.channels = 1;
    check(quell_clean_read(clean, NULL, &target) == QUELL_OK, "the expected error");
    for (int i = 0; i < PIXELS; ++i) heard->noise += error[i];
    check(quell_clean_read(clean, "depth", &target) == QUELL_INVALID_ARGUMENT, "depth is not filtered");
    check(quell_clean_read(clean, "color", NULL) == QUELL_INVALID_ARGUMENT, "no target");
    target.data = NULL;
    check(quell_clean_read(clean, "color", &target) == QUELL_INVALID_ARGUMENT, "no room");
    check(quell_clean_read(NULL, "color", &target) == QUELL_INVALID_ARGUMENT, "no frame");
    return heard->count == heard->stop_at;
}

static int warnings = 0;
static void warn(void *user, const char *text) {
    ++*(int *)user;
    check(strlen(text) > 10, "a sentence");
}

/* Another thread while this one is inside. */
static quell_sequence *shared;
static void *intrude(void *status) {
    *(quell_status *)status = quell_sequence_set(shared, "gather.frames", "2");
    return NULL;
}

static int hold(void *user, const quell_clean *clean) {
    pthread_t thread;
    (void)clean;
    pthread_create(&thread, NULL, intrude, user);
    pthread_join(thread, NULL);
    return 0;
}

int main(void) {
    char text[256];
    quell_sequence *s = NULL;
    quell_sequence_options options;
    memset(&options, 0, sizeof options);

    check(quell_sequence_create(&options, &s, text, sizeof text) == QUELL_INVALID_ARGUMENT && strstr(text, "struct_size is 0"), "size 0");
    options.struct_size = sizeof options;
    options.motion = "pixels";
    options.warn = warn;
    options.warn_user = &warnings;
    check(quell_sequence_create(&options, NULL, text, sizeof text) == QUELL_INVALID_ARGUMENT, "no room for the handle");
    options.preset = "paper";
    check(quell_sequence_create(&options, &s, text, sizeof text) == QUELL_INVALID_ARGUMENT && strstr(text, "sequence-short"), "a preset of the other filter");
    options.preset = "sequence-short";
    check(quell_sequence_create(&options, &s, NULL, 0) == QUELL_OK, "it is made");

    /* Handles that are none. */
    static long long zeros[64];
    check(quell_sequence_flush(NULL, NULL, NULL) == QUELL_INVALID_ARGUMENT, "null");
    check(quell_sequence_flush((quell_sequence *)zeros, NULL, NULL) == QUELL_INVALID_ARGUMENT, "memory of another kind");
    quell_sequence_free(NULL);
    quell_sequence_free((quell_sequence *)zeros);

    refused(s, quell_sequence_set(s, "gather.framse", "3"), "did you mean gather.frames");
    refused(s, quell_sequence_set(s, "gather.frames", "many"), "gather.frames");
    refused(s, quell_sequence_set(s, NULL, "3"), "a null pointer");
    check(quell_sequence_set(s, "gather.frames", "2") == QUELL_OK, "a parameter");
    check(quell_sequence_set(s, "stabilise.frames", "1") == QUELL_OK, "a parameter");

    fill(1);
    quell_pass good[3] = {pass("color", color, 3), pass("depth", depth, 1), pass("motion", motion, 2)};
    good[0].role = "beauty";
    quell_pass p[3];
    quell_frame f = frame(1, p, 3);
    struct heard heard = {{0}, 0, 0, 0.0f, 0.0f};
#define BAD(change, words)                                       \
    memcpy(p, good, sizeof p);                                   \
    f = frame(1, p, 3);                                          \
    change;                                                      \
    refused(s, quell_sequence_push(s, &f, ready, &heard), words)
    refused(s, quell_sequence_push(s, NULL, ready, &heard), "frame: a null pointer");
    BAD(f.struct_size = 3, "frame: struct_size is 3");
    BAD(f.width = 0, "0x14");
    BAD(f.height = 4000000000u, "each extent must be 1 to 65536");
    BAD(f.passes = NULL, "passes is null");
    BAD(f.pass_count = 0, "0 channels");
    BAD(p[0].struct_size = 0, "struct_size is 0");
    BAD(p[2].struct_size = 16, "pass 2: struct_size differs");
    BAD(p[1].name = NULL, "pass 1: without a name");
    BAD(p[1].name = "\xff", "no UTF-8");
    BAD(p[1].name = "bueaty", "no renderer calls a pass like this");
    BAD(p[1].role = "depths", "`depths` is no role");
    BAD(p[1].name = "color", "two passes of this name");
    BAD(p[0].type = 7, "color: type 7");
    BAD(p[0].channels = 0, "color: 0 channels");
    BAD(p[0].channels = 9, "color: 9 channels");
    BAD(p[2].data = NULL, "motion: data is null");
    BAD(p[2].channels = 1, "motion");

    /* It goes on: five frames, of which one is refused for its size and one has numbers that are none. */
    memcpy(p, good, sizeof p);
    for (int number = 1; number <= 5; ++number) {
        fill(number);
        if (number == 3) color[7] = NAN, color[100] = INFINITY;
        f = frame(number, p, 3);
        check(quell_sequence_push(s, &f, ready, &heard) == QUELL_OK, "a frame");
        f.width = WIDTH - 1;
        refused(s, quell_sequence_push(s, &f, ready, &heard), "19x14, but the sequence is 20x14");
        f = frame(number + 1, p, 2);
        refused(s, quell_sequence_push(s, &f, ready, &heard), number == 1 ? "" : "its passes are not those");
        if (number == 1) break;
    }
    /* The second frame decides: that one did not fit the first, so the sequence begins anew. */
    check(quell_sequence_flush(s, ready, &heard) == QUELL_OK, "flushed");
    heard.count = 0;
    for (int number = 1; number <= 5; ++number) {
        fill(number);
        if (number == 3) color[7] = NAN, color[100] = INFINITY;
        f = frame(number, p, 3);
        check(quell_sequence_push(s, &f, ready, &heard) == QUELL_OK, "a frame");
    }
    for (int number = 5; number > 3; --number) {
        f = frame(number, p, 3);
        refused(s, quell_sequence_push(s, &f, ready, &heard), "after 5; numbers rise");
    }
    refused(s, quell_sequence_set(s, "gather.frames", "1"), "frames are inside");
    check(quell_sequence_flush(s, ready, &heard) == QUELL_OK, "flushed");
    check(heard.count == 5 && heard.numbers[0] == 1 && heard.numbers[4] == 5, "all came out, in order");
    check(heard.noise > 0.0f, "an expected error");
    check(warnings > 0, "numbers that are none are told");

    /* Half floats, rows from the bottom, one plane a channel: the same frame laid out in another way gives the same sum. */
    float sums[2];
    for (int way = 0; way < 2; ++way) {
        static float planar[3 * PIXELS];
        fill(9);
        for (int i = 0; i < PIXELS; ++i)
            for (int c = 0; c < 3; ++c) planar[c * PIXELS + (HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH] = color[3 * i + c];
        memcpy(p, good, sizeof p);
        if (way) {
            p[0].data = planar + (HEIGHT - 1) * WIDTH;
            p[0].channel_stride = PIXELS * (ptrdiff_t)sizeof(float);
            p[0].pixel_stride = sizeof(float);
            p[0].row_stride = -WIDTH * (ptrdiff_t)sizeof(float);
        }
        memset(&heard, 0, sizeof heard);
        f = frame(1, p, 3);
        check(quell_sequence_push(s, &f, ready, &heard) == QUELL_OK, "a frame");
        check(quell_sequence_flush(s, ready, &heard) == QUELL_OK, "flushed");
        sums[way] = heard.sum;
    }
    check(sums[0] == sums[1] && sums[0] > 0.0f, "strides");
    for (int i = 0; i < 3 * PIXELS; ++i) halves[i] = 0x3c00;
    p[0] = pass("color", halves, 3);
    p[0].type = QUELL_F16;
    memset(&heard, 0, sizeof heard);
    f = frame(1, p, 3);
    check(quell_sequence_push(s, &f, ready, &heard) == QUELL_OK && quell_sequence_flush(s, ready, &heard) == QUELL_OK, "halves");
    check(fabsf(heard.sum - 3 * PIXELS) < 1.0f, "constant in, constant out");

    /* A callback that stops, and one during which another thread comes. */
    memcpy(p, good, sizeof p);
    memset(&heard, 0, sizeof heard);
    heard.stop_at = 2;
    for (int number = 1; number <= 4; ++number) {
        f = frame(number, p, 3);
        check(quell_sequence_push(s, &f, ready, &heard) == QUELL_OK, "a frame");
    }
    check(quell_sequence_flush(s, ready, &heard) == QUELL_STOPPED && heard.count == 2, "stopped");
    check(quell_sequence_flush(s, ready, &heard) == QUELL_OK && heard.count == 2, "and given up");
    quell_status other = QUELL_OK;
    shared = s;
    f = frame(1, p, 3);
    check(quell_sequence_push(s, &f, hold, &other) == QUELL_OK, "a frame");
    check(quell_sequence_flush(s, hold, &other) == QUELL_OK && other == QUELL_BUSY, "busy");
    check(quell_sequence_message(s, text, 8) > 8 && strlen(text) == 7, "a sentence is cut to its room");

    quell_sequence_free(s);
    if (failures == 0) puts("every bad input was refused, and the handle went on");
    return failures != 0;
}
