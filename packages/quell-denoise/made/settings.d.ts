// Made by make.mjs.

/** Names of presets. */
export type Preset = "paper" | "quality";

/** Debug views; docs/integrating.md shows what each looks like. */
export type DebugView = "confidence" | "confidence_in" | "depth" | "depth_error" | "glossy_hit" | "history_length" | "light" | "motion" | "motion_error" | "normal" | "normal_error" | "rejection" | "roughness" | "surface_id" | "weight_sum" | "weights_around" | "world_grid";

/** Parameters of the stages by name; docs/parameters.md says what each does, and where its value comes from. */
export interface Settings {
  /** Image of this frame that is the next frame's matte history. Preset paper: blend. */
  "pipeline.feedback"?: "temporal" | "prefilter" | "blend" | "firefly" | "bilateral";
  /** Distance that rejects history. Preset paper: plane. */
  "surface.rejection"?: "off" | "plane" | "point";
  /** Plane distance at which trust begins to fall (never under `pixel_distance`). From 0 to 1, of view depth. Preset paper: 0.005. */
  "surface.plane_distance"?: number;
  /** Least plane distance at which trust begins to fall. From 0 to 16, pixel sizes at that depth. Preset paper: 1. */
  "surface.pixel_distance"?: number;
  /** Point distance at which trust begins to fall, where `rejection` is `point`. From 0 to 1, of view depth. Preset paper: 0.01. */
  "surface.point_distance"?: number;
  /** Distance at which trust is 0. From 1 to 10, of the distance above. Preset paper: 1.4. */
  "surface.falloff"?: number;
  /** Least cosine between the normals now and then. From -1 to 1, cosine. Preset paper: 0.5. */
  "surface.normal_min"?: number;
  /** A surface counts as unmoved where its motion differs from the camera's own by less. From 0 to 16, pixels. Preset paper: 1. */
  "surface.static_motion"?: number;
  /** How far in depth a moving surface may have come from. From 0 to 10, of view depth. Preset paper: 0.1. */
  "surface.moving_depth"?: number;
  /** Border of the previous image that is not trusted. From 0 to 64, pixels. Preset paper: 0. */
  "surface.guard_band"?: number;
  /** Where only the part f of the bilinear footprint shows the surface, trust is times f / (f + this (1 - f)). From 0 to 64. Preset paper: 0. */
  "surface.lost_footprint"?: number;
  /** History length at which confidence is full. From 1 to 64, frames. Preset paper: 4. */
  "surface.confidence_frames"?: number;
  /** Switch of the stage. Preset paper: true. */
  "matte_temporal.enabled"?: boolean;
  /** Most that history may count. The window is 1 / (1 - alpha) frames. From 0 to 0.999, share of history. Preset paper: 0.98. */
  "matte_temporal.alpha"?: number;
  /** History of N frames counts at most N / (N + 1): a plain mean at first. Preset paper: true. */
  "matte_temporal.ramp"?: boolean;
  /** Clamp of history to the current signal's neighbourhood. Preset paper: off. */
  "matte_temporal.clip"?: "off" | "box" | "sigma";
  /** Radius of the clamp's window. From 1 to 4, pixels. Preset paper: 2. */
  "matte_temporal.clip_radius"?: number;
  /** Width of the clamp where `clip` is `sigma`. From 0 to 16, standard deviations. Preset paper: 1.5. */
  "matte_temporal.clip_gamma"?: number;
  /** Shortens the matte history where light has changed. Preset paper: false. */
  "changed_light.matte"?: boolean;
  /** Shortens the glossy history where light has changed. Preset paper: false. */
  "changed_light.glossy"?: boolean;
  /** Most that history counts in the fast mean. Its window is 1 / (1 - fast) frames. From 0 to 0.95, share of history. Preset paper: 0.6. */
  "changed_light.fast"?: number;
  /** Difference between the fast and the long history, both averaged over the window, from which history gets shorter. From 0 to 64, standard deviations. Preset paper: 1.5. */
  "changed_light.begin"?: number;
  /** Difference at which nothing is left of history; at least `begin`. From 0 to 64, standard deviations. Preset paper: 2. */
  "changed_light.certain"?: number;
  /** A difference that counts as one deviation whatever the noise. From 0 to 10, of the sum of both means. Preset paper: 0.03. */
  "changed_light.least"?: number;
  /** Half the width of the window around the pixel, which falls off as a tent. From 1 to 3, cells of 8x8 pixels. Preset paper: 3. */
  "changed_light.radius"?: number;
  /** Distance between the taps of a cell along both axes. From 1 to 4, pixels. Preset paper: 1. */
  "changed_light.spacing"?: number;
  /** Filters the matte signal after stage 3. Preset paper: false. */
  "young_filter.matte"?: boolean;
  /** Filters the glossy signal after stage 8. Preset paper: false. */
  "young_filter.glossy"?: boolean;
  /** History length at which the finest level has faded out. From 1 to 256, frames. Preset paper: 32. */
  "young_filter.frames"?: number;
  /** When the levels of 3 and 9 pixels fade out. From 0.01 to 1, of the level before's frames. Preset paper: 0.5. */
  "young_filter.falloff"?: number;
  /** Levels of the matte signal; their taps lie 1, 3, 9 and 27 pixels apart. From 0 to 4. Preset paper: 3. */
  "young_filter.matte_levels"?: number;
  /** Levels of the glossy signal: 1, 3 and 9 pixels. From 0 to 3. Preset paper: 3. */
  "young_filter.glossy_levels"?: number;
  /** History length at which the matte level of 27 pixels has faded out, with `matte_stays` too; at most 1: there is no such level. From 0 to 256, frames. Preset paper: 12. */
  "young_filter.wide_frames"?: number;
  /** The first three matte levels do not fade out; `deviations` should be above 0. Preset paper: false. */
  "young_filter.matte_stays"?: boolean;
  /** Glossy only: a level fades out where its taps lie farther apart than this. From 0 to 64, of the lobe's footprint. Preset paper: 1. */
  "young_filter.lobe"?: number;
  /** Glossy only: the least footprint that counts, of mirrors too. From 0 to 64, pixels. Preset paper: 0. */
  "young_filter.least_lobe"?: number;
  /** From the second level on, a neighbour whose luminance differs by as much counts nothing; 0: no such stop. From 0 to 64, standard deviations of the noise. Preset paper: 0. */
  "young_filter.deviations"?: number;
  /** Matte only, first level: a neighbour whose luminance differs by this times the pair's mean and the root of 1 / N_p + 1 / N_q counts nothing (which none does before half its square in frames), others less; 0: no such stop. From 0 to 64, of the mean, for one frame. Preset paper: 0. */
  "young_filter.matte_contrast"?: number;
  /** The same for the glossy signal. From 0 to 64, of the mean, for one frame. Preset paper: 0. */
  "young_filter.glossy_contrast"?: number;
  /** From the second level on, noise counts for `deviations` as far as this part of `matte_contrast` and `glossy_contrast` allows, or as it is found at both pixels; 0: as far as it is found at either. From 0 to 8, of the first level's contrast. Preset paper: 0. */
  "young_filter.further_contrast"?: number;
  /** Variance of a pair's difference in luminance from which the contact stop is off; 0: it acts whatever the noise. From 0 to 64, of the squared mean of a pair. Preset paper: 0. */
  "young_filter.contact_noise"?: number;
  /** First level: as far as the weights of the eight neighbours add up to less than 1, all of them count, whatever surface they show, by up to this many frames less the pixel's own. From 0 to 64, frames. Preset paper: 0. */
  "young_filter.isolated"?: number;
  /** Kz: fall of the weight with the distance in depth from the tangent plane. From 0 to 1000, per relative depth. Preset paper: 5. */
  "edge.depth"?: number;
  /** Kn: fall of the weight with 1 - cosine^4 of the normals. From 0 to 100. Preset paper: 1. */
  "edge.normal"?: number;
  /** Kp: fall of the weight with the sine of the angle out of the tangent planes. From 0 to 100. Preset paper: 1. */
  "edge.plane"?: number;
  /** Kg of the matte stages: fall of the weight with the difference in smoothness. From 0 to 100. Preset paper: 0. */
  "edge.matte_gloss"?: number;
  /** Kg of the glossy stages. From 0 to 100. Preset paper: 1. */
  "edge.glossy_gloss"?: number;
  /** Along a separable kernel's line, outwards, the weight may only fall. Preset paper: false. */
  "edge.monotone"?: boolean;
  /** Matte stages 4 and 7, and the filter by history: where another surface meets the one that a pair of pixels shows, the pair counts nothing from this closeness on, less before; 0: no such stop. From 0 to 16. Preset paper: 0. */
  "edge.contact"?: number;
  /** Switch of the stage. Preset paper: true. */
  "matte_prefilter.enabled"?: boolean;
  /** Taps of the spiral. From 1 to 64. Preset paper: 24. */
  "matte_prefilter.taps"?: number;
  /** Radius of the spiral. From 0 to 256, pixels at 720 rows. Preset paper: 32. */
  "matte_prefilter.radius"?: number;
  /** Gaussian over the spiral. From 0.05 to 10, of the radius. Preset paper: 0.5. */
  "matte_prefilter.sigma"?: number;
  /** Turns of the spiral; 0: the best known for the number of taps. From 0 to 63. Preset paper: 0. */
  "matte_prefilter.turns"?: number;
  /** The pattern changes from frame to frame. Preset paper: true. */
  "matte_prefilter.rotate"?: boolean;
  /** Taps beyond the image's edge. Preset paper: skip. */
  "matte_prefilter.off_screen"?: "skip" | "mirror";
  /** Switch of the stage. Preset paper: true. */
  "disocclusion.enabled"?: boolean;
  /** Radius of the maximum of distrust. From 0 to 8, pixels. Preset paper: 3. */
  "disocclusion.radius"?: number;
  /** Radius of the blur of distrust after its maximum. From 0 to 8, pixels. Preset paper: 3. */
  "disocclusion.blur"?: number;
  /** Least share of the prefiltered image in the output. From 0 to 1, share of stage 4. Preset paper: 0. */
  "disocclusion.floor"?: number;
  /** Least share of the prefiltered image in what `pipeline.feedback = blend` feeds back. From 0 to 1, share of stage 4. Preset paper: 0.1. */
  "disocclusion.feedback_floor"?: number;
  /** Switch of the stage. Preset paper: true. */
  "firefly.enabled"?: boolean;
  /** What the median chooses. Preset paper: channel. */
  "firefly.median"?: "channel" | "luminance";
  /** A value is replaced only where it exceeds the median by this factor. From 1 to 100, of the median. Preset paper: 2. */
  "firefly.threshold"?: number;
  /** Every value becomes the median, as in the engine. Preset paper: false. */
  "firefly.plain"?: boolean;
  /** What the median reads. Preset paper: disocclusion. */
  "firefly.input"?: "disocclusion" | "temporal";
  /** Switch of the stage. Preset paper: true. */
  "matte_bilateral.enabled"?: boolean;
  /** Taps of the spiral. From 1 to 64. Preset paper: 24. */
  "matte_bilateral.taps"?: number;
  /** Radius of the spiral. From 0 to 256, pixels at 720 rows. Preset paper: 32. */
  "matte_bilateral.radius"?: number;
  /** Gaussian over the spiral. From 0.05 to 10, of the radius. Preset paper: 0.5. */
  "matte_bilateral.sigma"?: number;
  /** Turns of the spiral; 0: the best known for the number of taps. From 0 to 63. Preset paper: 0. */
  "matte_bilateral.turns"?: number;
  /** The pattern changes from frame to frame. Preset paper: true. */
  "matte_bilateral.rotate"?: boolean;
  /** Taps beyond the image's edge. Preset paper: skip. */
  "matte_bilateral.off_screen"?: "skip" | "mirror";
  /** Switch of the stage. Preset paper: true. */
  "glossy_temporal.enabled"?: boolean;
  /** History is fetched where the reflected image was, not the surface. Preset paper: true. */
  "glossy_temporal.virtual_reprojection"?: boolean;
  /** Most that history may count. From 0 to 0.999, share of history. Preset paper: 0.9. */
  "glossy_temporal.alpha"?: number;
  /** History of N frames counts at most N / (N + 1). Preset paper: true. */
  "glossy_temporal.ramp"?: boolean;
  /** Clamp of history to the current signal's neighbourhood. Preset paper: sigma. */
  "glossy_temporal.clip"?: "off" | "box" | "sigma";
  /** Radius of the clamp's window. From 1 to 4, pixels. Preset paper: 4. */
  "glossy_temporal.clip_radius"?: number;
  /** Width of the clamp where `clip` is `sigma`. From 0 to 16, standard deviations. Preset paper: 1.5. */
  "glossy_temporal.clip_gamma"?: number;
  /** Filter of the hit distance over 3x3 before use. Preset paper: min. */
  "glossy_temporal.hit_filter"?: "off" | "min" | "median";
  /** Below it a surface is a mirror: its hit distances are taken as they are, without `hit_filter`, and `hit_tolerance` acts. From 0 to 1, perceptual roughness. Preset paper: 0. */
  "glossy_temporal.mirror_roughness"?: number;
  /** On mirrors trust falls where the previous pixel's reflected ray ended nearer or farther than the reflected point by this; at `surface.falloff` times it nothing is left. Never under `surface.pixel_distance`. From 0 to 10, of the distance. Preset paper: 0.08. */
  "glossy_temporal.hit_tolerance"?: number;
  /** Below it history is fetched by Catmull and Rom's spline, from 4x4 pixels, where all four around the place show the reflector. Needs `clip`. From 0 to 1, perceptual roughness. Preset paper: 0. */
  "glossy_temporal.spline_roughness"?: number;
  /** On curved reflectors history is fetched where the previous surface reflected the same point. Preset paper: true. */
  "glossy_temporal.curvature"?: boolean;
  /** Hit distances beyond it count as it. From 0 to 1000000, of view depth. Preset paper: 1000. */
  "glossy_temporal.max_hit_distance"?: number;
  /** Least cosine between normals for taps to lie on the same reflector. From -1 to 1, cosine. Preset paper: 0.9. */
  "glossy_temporal.reflector_normal_min"?: number;
  /** Most by which the roughness of taps on the same reflector may differ. From 0 to 1, perceptual roughness. Preset paper: 0.1. */
  "glossy_temporal.reflector_roughness"?: number;
  /** Switch of both passes. Preset paper: true. */
  "glossy_bilateral.enabled"?: boolean;
  /** How the kernel is sized. Preset paper: footprint. */
  "glossy_bilateral.radius"?: "footprint" | "constant";
  /** The footprint shrinks where the surface bends along the axis. Preset paper: true. */
  "glossy_bilateral.curvature"?: boolean;
  /** Largest radius. From 0 to 64, pixels at 720 rows. Preset paper: 12. */
  "glossy_bilateral.max_radius"?: number;
  /** Below it nothing is filtered. From 0 to 8, pixels. Preset paper: 0.5. */
  "glossy_bilateral.min_radius"?: number;
  /** Distance between taps. From 0.5 to 8, pixels at 720 rows. Preset paper: 2. */
  "glossy_bilateral.step"?: number;
  /** Gaussian over the kernel. From 0.05 to 10, of the radius. Preset paper: 0.75. */
  "glossy_bilateral.sigma"?: number;
  /** Radius where `radius` is `constant`. From 0 to 64, pixels at 720 rows. Preset paper: 8. */
  "glossy_bilateral.constant_radius"?: number;
  /** Switch of the stage. It acts only on frames with jitter. Preset paper: true. */
  "direct_taa.enabled"?: boolean;
  /** Most that history may count. From 0 to 0.99, share of history. Preset paper: 0.6. */
  "direct_taa.history"?: number;
  /** Motion at which history counts nothing. From 0.1 to 1000, pixels at 720 rows. Preset paper: 8. */
  "direct_taa.motion_falloff"?: number;
  /** Fall of history's share with the amount that the clamp changed. From 0 to 100, per relative change. Preset paper: 1. */
  "direct_taa.clamp_falloff"?: number;
  /** Switch of the stage. It acts only on frames with jitter, and takes the place of stage 11. Preset paper: false. */
  "antialiasing.enabled"?: boolean;
  /** Least that the new frame counts, where nothing moves. From 0.01 to 1, share of the new frame. Preset paper: 0.08. */
  "antialiasing.least"?: number;
  /** What is added to `least` where history is fetched half way between pixels on both axes. From 0 to 1, share of the new frame. Preset paper: 0.6. */
  "antialiasing.resampling"?: number;
  /** History is held to the mean of 3x3 pixels plus and minus so many. From 0 to 16, standard deviations. Preset paper: 1.5. */
  "antialiasing.gamma"?: number;
  /** Frames of history are divided by 1 plus this times the share of its luminance that the clamp changed. From 0 to 1000, per relative change. Preset paper: 40. */
  "antialiasing.change_falloff"?: number;
  /** History may also show the colours of what is nearer, within so many pixels; 0: not. From 0 to 3, pixels. Preset paper: 3. */
  "antialiasing.thin_radius"?: number;
  /** By so much must it be nearer than the farthest surface of 3x3 pixels. From 0.001 to 1, of the depth. Preset paper: 0.4. */
  "antialiasing.thin_depth"?: number;
  /** Its motion may differ by so much from that which history is fetched by. From 0 to 16, pixels. Preset paper: 0.5. */
  "antialiasing.thin_motion"?: number;
}
