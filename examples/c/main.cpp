// A C++ host of quell: frames of a wall of stripes that moves by two pixels a frame, with one sample of light a pixel, pushed as they
// are "rendered"; clean ones come out as soon as their window is full. Ends with 1 where the noise did not fall.
#include <cmath>
#include <cstdio>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include <quell.h>

namespace {

constexpr uint32_t WIDTH = 48, HEIGHT = 32;
constexpr int FRAMES = 6;

struct Free {
    void operator()(quell_sequence *sequence) const { quell_sequence_free(sequence); }
};
using Sequence = std::unique_ptr<quell_sequence, Free>;

// What a renderer hands over: pixels with all their numbers side by side, which strides describe.
struct Pixel {
    float color[3], albedo[3], normal[3], depth, motion[2];
};
using Frame = std::vector<Pixel>;

Frame render(int number) {
    std::mt19937 random(number);
    std::exponential_distribution<float> light(1.0f);
    Frame frame(WIDTH * HEIGHT);
    for (uint32_t i = 0; i < frame.size(); ++i) {
        const bool stripe = ((i % WIDTH + 2 * number) / 6) % 2 == 0;
        const float albedo[3] = {stripe ? 0.8f : 0.1f, stripe ? 0.5f : 0.3f, stripe ? 0.2f : 0.6f};
        Pixel &pixel = frame[i];
        for (int c = 0; c < 3; ++c) {
            pixel.albedo[c] = albedo[c];
            pixel.color[c] = albedo[c] * light(random);
            pixel.normal[c] = c == 2 ? 1.0f : 0.0f;
        }
        pixel.depth = 3.0f;
        // The surface was two pixels further right in the frame before.
        pixel.motion[0] = 2.0f;
        pixel.motion[1] = 0.0f;
    }
    return frame;
}

quell_pass pass(const char *name, const char *role, const float *first, uint32_t channels) {
    quell_pass pass{};
    pass.struct_size = sizeof pass;
    pass.name = name;
    pass.role = role;
    pass.data = first;
    pass.type = QUELL_F32;
    pass.channels = channels;
    pass.pixel_stride = sizeof(Pixel);
    return pass;
}

// Mean squared difference from the light's mean, 1, times the surface's colour.
double error(const Frame &frame, const std::vector<float> *color = nullptr) {
    double sum = 0.0;
    for (size_t i = 0; i < frame.size(); ++i)
        for (int c = 0; c < 3; ++c) {
            const double value = color ? (*color)[3 * i + c] : frame[i].color[c];
            sum += std::pow(value - frame[i].albedo[c], 2);
        }
    return sum / (3.0 * frame.size());
}

struct Job {
    std::vector<Frame> frames;
    double before = 0.0, after = 0.0;
    int came = 0;
};

// Hears of each clean frame.
int ready(void *user, const quell_clean *clean) {
    auto &job = *static_cast<Job *>(user);
    const Frame &noisy = job.frames[static_cast<size_t>(quell_clean_number(clean)) - 1];
    std::vector<float> color(3 * noisy.size());
    quell_target target{};
    target.struct_size = sizeof target;
    target.data = color.data();
    target.type = QUELL_F32;
    target.channels = 3;
    if (quell_clean_read(clean, "color", &target) != QUELL_OK) return 1;
    job.before += error(noisy);
    job.after += error(noisy, &color);
    ++job.came;
    return 0;
}

void warn(void *, const char *text) { std::fprintf(stderr, "warning: %s\n", text); }

void check(const Sequence &sequence, quell_status status) {
    if (status == QUELL_OK) return;
    char text[512];
    quell_sequence_message(sequence.get(), text, sizeof text);
    throw std::runtime_error(text);
}

void run(Job &job) {
    quell_sequence_options options{};
    options.struct_size = sizeof options;
    options.motion = "pixels";
    options.warn = warn;
    char text[512];
    quell_sequence *made = nullptr;
    if (quell_sequence_create(&options, &made, text, sizeof text) != QUELL_OK) throw std::runtime_error(text);
    const Sequence sequence(made);
    check(sequence, quell_sequence_set(sequence.get(), "gather.frames", "3"));
    for (int number = 1; number <= FRAMES; ++number) {
        job.frames.push_back(render(number));
        const Pixel &p = job.frames.back().front();
        const quell_pass passes[] = {pass("color", "beauty", p.color, 3), pass("albedo", nullptr, p.albedo, 3),
                                     pass("normal", nullptr, p.normal, 3), pass("depth", nullptr, &p.depth, 1),
                                     pass("motion", nullptr, p.motion, 2)};
        quell_frame frame{};
        frame.struct_size = sizeof frame;
        frame.number = number;
        frame.width = WIDTH;
        frame.height = HEIGHT;
        frame.passes = passes;
        frame.pass_count = std::size(passes);
        check(sequence, quell_sequence_push(sequence.get(), &frame, ready, &job));
    }
    check(sequence, quell_sequence_flush(sequence.get(), ready, &job));
}

}  // namespace

int main() {
    Job job;
    try {
        run(job);
    } catch (const std::exception &failure) {
        std::fprintf(stderr, "error: %s\n", failure.what());
        return 1;
    }
    std::printf("quell %s: %d frames, mean squared error %.5f -> %.5f\n", quell_version(), job.came, job.before / FRAMES,
                job.after / FRAMES);
    return job.came == FRAMES && job.after < 0.05 * job.before ? 0 : 1;
}
