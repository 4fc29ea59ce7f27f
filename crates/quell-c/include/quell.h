/* quell: removes the noise from path-traced light. The C interface, C11 and C++17. docs/c.md has worked examples.
 *
 * quell_sequence is the filter of animations, which looks at frames before and after each one; quell_realtime the filter of the next
 * frame.
 *
 * Every function that can fail returns a quell_status; quell_..._message has the sentence. A handle is used by one thread at
 * a time (another gets QUELL_BUSY), several handles by several threads. Nothing is global, nothing is printed, nothing aborts.
 * Callbacks run in the calling thread, before the call returns, and must not throw.
 *
 * Structs begin with their size: set it to sizeof the struct (and the rest to zero, where you have no value). So a program
 * that was built against this header works with later libraries, whose structs have more members.
 */
#ifndef QUELL_H
#define QUELL_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef int quell_status;
#define QUELL_OK 0
#define QUELL_INVALID_ARGUMENT 1 /* an argument cannot be used; the handle is as it was before */
#define QUELL_BUSY 2             /* another thread is inside this handle */
#define QUELL_STOPPED 3          /* the callback asked to stop; what was inside is given up */
#define QUELL_FAILED 4           /* anything else; what was inside is given up */

/* Types of numbers. */
#define QUELL_F16 1u
#define QUELL_F32 2u
#define QUELL_U32 3u /* for surface_id alone */

/* The library's version, such as "0.1.0". */
const char *quell_version(void);

/* One pass of a frame. Numbers are read before the call returns and never written.
 *
 * role: what it is (beauty, albedo, normal, depth, motion, position, variance, matte_direct, glossy_indirect, emission, ...), or NULL: told from
 * the name, by quell's words or those of a renderer ("DiffDir", "specular_indirect", "Vector").
 * Light is scene-linear; normals lie in world space; depth along the camera's axis, infinite or 0 where there is no surface; motion
 * as quell_sequence_options.motion says.
 * Strides are bytes from one channel, pixel, row to the next, and may be negative; 0: packed, channel by channel, pixel by pixel,
 * rows from the top. */
typedef struct quell_pass {
    size_t struct_size;
    const char *name;
    const char *role;
    const void *data;
    uint32_t type;     /* QUELL_F16, QUELL_F32 */
    uint32_t channels; /* 1 to 4 */
    ptrdiff_t channel_stride;
    ptrdiff_t pixel_stride;
    ptrdiff_t row_stride;
} quell_pass;

/* A frame. All frames of a sequence have the same size and the same passes. */
typedef struct quell_frame {
    size_t struct_size;
    int64_t number; /* a gap begins a new shot; one that is not higher than the last is refused, unless that was flushed */
    uint32_t width;
    uint32_t height;
    const quell_pass *passes;
    size_t pass_count;
    const float *clip_from_world; /* 16 numbers, column-major, x right, y up; NULL: unknown */
} quell_frame;

/* Where to put numbers; members as in quell_pass. */
typedef struct quell_target {
    size_t struct_size;
    void *data;
    uint32_t type;
    uint32_t channels;
    ptrdiff_t channel_stride;
    ptrdiff_t pixel_stride;
    ptrdiff_t row_stride;
} quell_target;

/* A frame that came out; it is valid while the callback runs. */
typedef struct quell_clean quell_clean;

/* Its number. */
int64_t quell_clean_number(const quell_clean *clean);

/* The name of filtered pass number index, and how many channels it has (channels may be NULL); NULL behind the last. */
const char *quell_clean_pass(const quell_clean *clean, size_t index, uint32_t *channels);

/* Puts the numbers of a filtered pass, by the name under which it was pushed, where target says; fewer channels than the pass
 * has are its first ones. Name NULL: the expected error of the picture, one channel, in the picture's units. */
quell_status quell_clean_read(const quell_clean *clean, const char *name, const quell_target *target);

/* Hears of each frame that is ready; anything but 0 stops. */
typedef int (*quell_ready)(void *user, const quell_clean *clean);

/* Hears, in a sentence, what spoils the result: missing motion, passes that do not add up, colours that are no numbers. */
typedef void (*quell_warn)(void *user, const char *text);

typedef struct quell_sequence_options {
    size_t struct_size;
    uint32_t threads; /* 0: as many as the machine has */
    /* What motion vectors mean. "pixels": the surface was at pixel + motion in the frame before, x right, y down (two further numbers
     * lead to the next frame); "blender", "arnold", "renderman", "nuke", "uv": as they write them; "auto": found out from two frames;
     * "none". NULL: the renderer's, where names of passes tell it, else found out. */
    const char *motion;
    const char *renderer; /* whose names and conventions the passes have ("blender", "mitsuba", ...); NULL: told from the names */
    quell_warn warn;      /* NULL: nobody hears */
    void *warn_user;
    const char *preset; /* "sequence", "sequence-short" (less memory, more noise); NULL: "sequence" */
} quell_sequence_options;

/* A sequence whose frames are pushed in order; clean ones come out as soon as 11 frames have followed (4 with preset
 * "sequence-short"). */
typedef struct quell_sequence quell_sequence;

/* Makes one; options may be NULL. Where it fails *sequence is not written, and message (NULL, or capacity bytes) has the sentence. */
quell_status quell_sequence_create(const quell_sequence_options *options, quell_sequence **sequence, char *message, size_t capacity);

/* Sets a parameter by name before the first frame; `quell explain --preset sequence` and docs/parameters.md list them. */
quell_status quell_sequence_set(quell_sequence *sequence, const char *parameter, const char *value);

/* Takes the next frame; ready hears of those that come out. */
quell_status quell_sequence_push(quell_sequence *sequence, const quell_frame *frame, quell_ready ready, void *user);

/* The end: the frames that are inside come out, and the next one pushed begins a new sequence. */
quell_status quell_sequence_flush(quell_sequence *sequence, quell_ready ready, void *user);

/* Why the last call that failed did so: at most capacity bytes with the zero behind them. Returns how many it takes without that. */
size_t quell_sequence_message(const quell_sequence *sequence, char *text, size_t capacity);

/* Frees it; NULL is nothing. A handle that was freed is refused where that can be seen, which is not always. */
void quell_sequence_free(quell_sequence *sequence);

/* The real-time filter: one frame in, the same frame out, with the history of those before. On the CPU; for the GPU take its shaders
 * (docs/shaders.md). */
typedef struct quell_realtime quell_realtime;

typedef struct quell_realtime_options {
    size_t struct_size;
    uint32_t width;
    uint32_t height;
    uint32_t threads;   /* 0: as many as the machine has */
    const char *preset; /* "quality", "paper" (as published in 2017); NULL: "quality" */
} quell_realtime_options;

/* The camera of a frame. World space is right-handed; clip space has x to the right, y up. */
typedef struct quell_camera {
    size_t struct_size;
    float clip_from_world[16]; /* column-major, without jitter: projection times view */
    float position[3];         /* of the eye, in world space */
    float jitter[2];           /* where samples lie, in pixels from the pixels' centres, x right, y down; where it is not 0, now or in
                                  the frame before, preset quality anti-aliases the picture over time */
} quell_camera;

/* A frame of the real-time filter. Planes are described as passes are, by name (role is not read):
 *
 *   direct                       3  radiance free of noise: emission, sky, analytic or filtered direct light
 *   matte, glossy                3  diffuse and specular light, without their weights
 *   matte_weight, glossy_weight  3  what multiplies them back: the albedo and its like
 *   direct_matte, direct_glossy  3  noisy direct light of the lobe, without its weight, added unfiltered
 *   depth                        1  along the camera's axis; infinite or 0: no surface
 *   normal                       3  world space, unit length, on the viewer's side; (0, 0, 0): no surface
 *   motion                       2  pixels, x right, y down: previous = current + motion
 *   roughness                    1  perceptual, 0..1
 *   glossy_hit_distance          1  from the surface to what the glossy ray met; infinite: it left the scene
 *   surface_id                   1  QUELL_U32, or a float that holds a whole number: other ids share no light
 *   confidence                   1  your own trust in history, 0..1
 *
 * A frame needs matte, glossy or both; everything else may be left out. */
typedef struct quell_realtime_frame {
    size_t struct_size;
    int64_t index; /* one that does not follow the last by one is a cut */
    const quell_camera *camera;
    const quell_camera *previous_camera; /* NULL: that of the last call */
    const quell_pass *planes;
    size_t plane_count;
} quell_realtime_frame;

/* Makes one. Where it fails *denoiser is not written, and message (NULL, or capacity bytes) has the sentence. */
quell_status quell_realtime_create(const quell_realtime_options *options, quell_realtime **denoiser, char *message, size_t capacity);

/* Sets a parameter by name, at any time; history is kept. `quell explain` and docs/parameters.md list them. */
quell_status quell_realtime_set(quell_realtime *denoiser, const char *parameter, const char *value);

/* Filters the next frame; *had_history (NULL: not wanted) is 1 where it continued the one before. After an error history is as it
 * was. */
quell_status quell_realtime_denoise(quell_realtime *denoiser, const quell_realtime_frame *frame, int *had_history);

/* Puts what the last frame became where target says: color (3, the sum; anti-aliased over
 * time where frames are jittered), direct, matte, glossy (3, without weights), confidence
 * (1, 0..1), history_length (1, frames). */
quell_status quell_realtime_read(quell_realtime *denoiser, const char *name, const quell_target *target);

/* Forgets history and the last frame. */
quell_status quell_realtime_reset(quell_realtime *denoiser);

/* As for a sequence. */
size_t quell_realtime_message(const quell_realtime *denoiser, char *text, size_t capacity);
void quell_realtime_free(quell_realtime *denoiser);

#ifdef __cplusplus
}
#endif

#endif
