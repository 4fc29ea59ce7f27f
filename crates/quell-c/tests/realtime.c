/* The real-time filter: noise falls as history grows, layouts do not matter, bad input is an error after which the handle goes on. C11. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <quell.h>

enum { WIDTH = 24, HEIGHT = 18, PIXELS = WIDTH * HEIGHT };

static int failures = 0;
static float matte[3 * PIXELS], weight[3 * PIXELS], normal[3 * PIXELS], depth[PIXELS];
static float shown[3 * PIXELS];

static void check(int good, const char *what) {
    if (!good) {
        fprintf(stderr, "FAILED: %s\n", what);
        ++failures;
    }
}

static void refused(const quell_realtime *d, quell_status status, const char *words) {
    char text[512];
    quell_realtime_message(d, text, sizeof text);
    if (status != QUELL_INVALID_ARGUMENT || !strstr(text, words)) {
        fprintf(stderr, "FAILED: status %d, `%s` is not in `%s`\n", status, words, text);
        ++failures;
    }
}

/* One path a pixel on a wall before the camera: mean 1. */
static void fill(int number) {
    srand((unsigned)number);
    for (int i = 0; i < PIXELS; ++i) {
        const float light = rand() % 5 == 0 ? 5.0f : 0.0f;
        for (int c = 0; c < 3; ++c) {
            matte[3 * i + c] = light;
            weight[3 * i + c] = 0.5f;
            normal[3 * i + c] = c == 2 ? 1.0f : 0.0f;
        }
        depth[i] = 3.0f;
    }
}

static quell_pass plane(const char *name, const void *data, unsigned channels) {
    quell_pass p;
    memset(&p, 0, sizeof p);
    p.struct_size = sizeof p;
    p.name = name;
    p.data = data;
    p.type = QUELL_F32;
    p.channels = channels;
    return p;
}

static quell_camera camera(void) {
    /* At the origin, looking along -z: an infinite, reversed projection. */
    static const float matrix[16] = {1.5f, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, -1, 0, 0, 0.1f, 0};
    quell_camera c;
    memset(&c, 0, sizeof c);
    c.struct_size = sizeof c;
    memcpy(c.clip_from_world, matrix, sizeof matrix);
    return c;
}

static quell_target target(float *data, unsigned channels) {
    quell_target t;
    memset(&t, 0, sizeof t);
    t.struct_size = sizeof t;
    t.data = data;
    t.type = QUELL_F32;
    t.channels = channels;
    return t;
}

static double error(void) {
    double sum = 0.0;
    for (int i = 0; i < 3 * PIXELS; ++i) sum += pow(shown[i] - 0.5, 2);
    return sum / (3 * PIXELS);
}

static quell_realtime *made(const char *preset) {
    char text[256];
    quell_realtime *d = NULL;
    quell_realtime_options options;
    memset(&options, 0, sizeof options);
    options.struct_size = sizeof options;
    options.width = WIDTH;
    options.height = HEIGHT;
    options.threads = 1;
    options.preset = preset;
    if (quell_realtime_create(&options, &d, text, sizeof text) != QUELL_OK) fprintf(stderr, "%s\n", text);
    return d;
}

int main(void) {
    char text[256];
    quell_realtime *d = NULL;
    quell_realtime_options options;
    memset(&options, 0, sizeof options);
    check(quell_realtime_create(NULL, &d, text, sizeof text) == QUELL_INVALID_ARGUMENT && strstr(text, "options: a null pointer"), "no options");
    options.struct_size = sizeof options;
    check(quell_realtime_create(&options, &d, text, sizeof text) == QUELL_INVALID_ARGUMENT && strstr(text, "0x0"), "no extent");
    options.width = WIDTH;
    options.height = HEIGHT;
    options.preset = "papr";
    check(quell_realtime_create(&options, &d, text, sizeof text) == QUELL_INVALID_ARGUMENT && strstr(text, "papr"), "no such preset");
    check(d == NULL, "nothing was made");

    d = made("paper");
    check(d != NULL, "it is made");
    quell_target all = target(shown, 3);
    refused(d, quell_realtime_read(d, "color", &all), "no frame was denoised yet");
    const quell_camera eye = camera();
    quell_pass good[4] = {plane("matte", matte, 3), plane("matte_weight", weight, 3), plane("depth", depth, 1), plane("normal", normal, 3)};
    quell_pass p[4];
    quell_realtime_frame f;
    memset(&f, 0, sizeof f);
    f.struct_size = sizeof f;
    f.camera = &eye;
    f.planes = p;
    f.plane_count = 4;

    double first = 0.0, last = 0.0;
    for (int number = 0; number < 12; ++number) {
        int had_history = -1;
        fill(number);
        memcpy(p, good, sizeof p);
        f.index = number;
        check(quell_realtime_denoise(d, &f, &had_history) == QUELL_OK, "a frame");
        check(had_history == (number > 0), "history from the second frame on");
        check(quell_realtime_read(d, "color", &all) == QUELL_OK, "the picture");
        last = error();
        if (number == 0) first = last;
    }
    check(last < 0.3 * first, "noise falls as history grows");
    float length[PIXELS];
    quell_target one = target(length, 1);
    check(quell_realtime_read(d, "history_length", &one) == QUELL_OK && length[PIXELS / 2] > 10.0f, "the length of history");
    check(quell_realtime_read(d, "confidence", &one) == QUELL_OK && length[PIXELS / 2] == 1.0f, "confidence");

    /* Every mistake between two frames, and the next frame is what it would have been. */
#define BAD(change, words)      \
    memcpy(p, good, sizeof p);  \
    f.camera = &eye;            \
    f.previous_camera = NULL;   \
    f.planes = p;               \
    f.plane_count = 4;          \
    change;                     \
    refused(d, quell_realtime_denoise(d, &f, NULL), words)
    quell_camera none = eye, cut = eye;
    memset(none.clip_from_world, 0, sizeof none.clip_from_world);
    cut.struct_size = 0;
    f.index = 12;
    fill(12);
    refused(d, quell_realtime_denoise(d, NULL, NULL), "frame: a null pointer");
    BAD(f.camera = NULL, "camera: a null pointer");
    BAD(f.camera = &cut, "camera: struct_size is 0");
    BAD(f.camera = &none, "singular");
    BAD(f.previous_camera = &cut, "previous_camera: struct_size is 0");
    BAD(f.planes = NULL, "frame: planes is null");
    BAD(p[2].struct_size = 16, "plane 2: struct_size differs");
    BAD(p[1].name = NULL, "plane 1: without a name");
    BAD(p[1].name = "beauty", "beauty: the real-time filter has no such plane");
    BAD(p[0].data = NULL, "matte: data is null");
    BAD(p[0].channels = 2, "matte: 2 channels, expected 3");
    BAD(p[2].channels = 3, "depth: 3 channels, expected 1");
    BAD(p[3].type = 9, "normal: type 9");
    BAD(p[0].type = QUELL_U32, "matte: type 3");
    refused(d, quell_realtime_set(d, "firefly.treshold", "3"), "firefly.threshold");
    refused(d, quell_realtime_set(d, "firefly.threshold", "0"), "firefly.threshold");
    refused(d, quell_realtime_read(d, "picture", &all), "`picture`; there are color");
    refused(d, quell_realtime_read(d, "glossy", &all), "no such signal");
    all.channels = 4;
    refused(d, quell_realtime_read(d, "color", &all), "4 channels, and color has 3");
    all.channels = 3;
    refused(d, quell_realtime_read(d, "color", NULL), "target: a null pointer");
    static long long zeros[64];
    check(quell_realtime_reset(NULL) == QUELL_INVALID_ARGUMENT, "null");
    check(quell_realtime_reset((quell_realtime *)zeros) == QUELL_INVALID_ARGUMENT, "memory of another kind");
    check(quell_sequence_flush((quell_sequence *)d, NULL, NULL) == QUELL_INVALID_ARGUMENT, "a handle of another kind");
    memcpy(p, good, sizeof p);
    f.camera = &eye;
    int had_history = 0;
    check(quell_realtime_denoise(d, &f, &had_history) == QUELL_OK && had_history == 1, "it goes on");
    check(quell_realtime_read(d, "color", &all) == QUELL_OK && fabs(error() - last) < 0.5 * last, "as before");

    /* Halves, one plane a channel, rows from the bottom, ids: the same numbers in another layout. */
    double sums[2];
    static float planar[3 * PIXELS];
    static unsigned ids[PIXELS];
    for (int i = 0; i < PIXELS; ++i) {
        ids[i] = 0xfffffff0u;
        for (int c = 0; c < 3; ++c) planar[c * PIXELS + (HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH] = matte[3 * i + c];
    }
    for (int way = 0; way < 2; ++way) {
        check(quell_realtime_reset(d) == QUELL_OK, "reset");
        memcpy(p, good, sizeof p);
        if (way) {
            p[0].data = planar + (HEIGHT - 1) * WIDTH;
            p[0].channel_stride = PIXELS * (ptrdiff_t)sizeof(float);
            p[0].pixel_stride = sizeof(float);
            p[0].row_stride = -WIDTH * (ptrdiff_t)sizeof(float);
            p[3] = plane("surface_id", ids, 1);
            p[3].type = QUELL_U32;
        } else {
            f.plane_count = 3;
        }
        check(quell_realtime_denoise(d, &f, &had_history) == QUELL_OK && had_history == 0, "afresh");
        f.plane_count = 4;
        check(quell_realtime_read(d, "color", &all) == QUELL_OK, "the picture");
        sums[way] = 0.0;
        for (int i = 0; i < 3 * PIXELS; ++i) sums[way] += shown[i];
    }
    check(sums[0] == sums[1] && sums[0] > 0.0, "strides");

    /* Values that are no numbers are repaired. */
    memcpy(p, good, sizeof p);
    matte[7] = NAN;
    depth[9] = NAN;
    normal[31] = INFINITY;
    check(quell_realtime_denoise(d, &f, NULL) == QUELL_OK && quell_realtime_read(d, "color", &all) == QUELL_OK, "no numbers");
    int finite = 1;
    for (int i = 0; i < 3 * PIXELS; ++i) finite = finite && isfinite(shown[i]);
    check(finite, "and none come out");

    /* A parameter changes the picture, another preset too. */
    check(quell_realtime_set(d, "matte_bilateral.enabled", "off") == QUELL_OK, "a parameter");
    quell_realtime_free(d);
    d = made(NULL);
    fill(0);
    f.index = 0;
    memcpy(p, good, sizeof p);
    check(quell_realtime_denoise(d, &f, NULL) == QUELL_OK && quell_realtime_read(d, "color", &all) == QUELL_OK, "the preset quality");
    check(error() < first, "which is smoother in the first frame");
    quell_realtime_free(d);
    quell_realtime_free(NULL);
    if (failures == 0) printf("the real-time filter: mean squared error %.4f -> %.4f\n", first, last);
    return failures != 0;
}
