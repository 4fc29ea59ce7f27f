//! What a pass is.

use quell::sequence::LightKind;

macro_rules! roles {
    ($($(#[doc = $doc:literal])+ $variant:ident = $name:literal,)+) => {
        /// What a pass of a file is, by the words of `--map ROLE=CHANNEL` and of the alias table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Role {
            $($(#[doc = $doc])+ $variant,)+
        }

        impl Role {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }
    };
}

roles! {
    /// The picture.
    Beauty = "beauty",
    /// Coverage.
    Alpha = "alpha",
    /// Diffuse light straight from sources.
    MatteDirect = "matte_direct",
    /// Diffuse light over other surfaces.
    MatteIndirect = "matte_indirect",
    /// Both in one.
    Matte = "matte",
    /// What multiplies diffuse light.
    MatteColour = "matte_colour",
    /// Light scattered below the surface, straight from sources.
    SubsurfaceDirect = "subsurface_direct",
    /// The same over other surfaces.
    SubsurfaceIndirect = "subsurface_indirect",
    /// Both in one.
    Subsurface = "subsurface",
    /// What multiplies it.
    SubsurfaceColour = "subsurface_colour",
    /// Highlights.
    GlossyDirect = "glossy_direct",
    /// Reflections.
    GlossyIndirect = "glossy_indirect",
    /// Both in one.
    Glossy = "glossy",
    /// What multiplies glossy light.
    GlossyColour = "glossy_colour",
    /// Highlights of a coat.
    CoatDirect = "coat_direct",
    /// Reflections of a coat.
    CoatIndirect = "coat_indirect",
    /// Both in one.
    Coat = "coat",
    /// Sheen straight from sources.
    SheenDirect = "sheen_direct",
    /// Sheen over other surfaces.
    SheenIndirect = "sheen_indirect",
    /// Both in one.
    Sheen = "sheen",
    /// Light through the surface, straight from sources.
    TransmissionDirect = "transmission_direct",
    /// The same over other surfaces.
    TransmissionIndirect = "transmission_indirect",
    /// Both in one.
    Transmission = "transmission",
    /// What multiplies it.
    TransmissionColour = "transmission_colour",
    /// Light scattered once in a medium.
    VolumeDirect = "volume_direct",
    /// Light scattered in a medium after other surfaces.
    VolumeIndirect = "volume_indirect",
    /// Both in one.
    Volume = "volume",
    /// What surfaces emit.
    Emission = "emission",
    /// Background.
    Environment = "environment",
    /// The beauty from some lights alone.
    LightGroup = "light_group",
    /// Colour of the surface, all lobes together.
    Albedo = "albedo",
    /// Shading normal.
    Normal = "normal",
    /// Colour of the first rough surface behind mirrors and glass.
    SeenAlbedo = "seen_albedo",
    /// Its normal.
    SeenNormal = "seen_normal",
    /// Length of the path to it.
    SeenDepth = "seen_depth",
    /// Distance from the camera.
    Depth = "depth",
    /// Position of the surface.
    Position = "position",
    /// Motion by the renderer's own convention; a second pair of components is the other direction of time.
    Motion = "motion",
    /// Motion to the frame before.
    MotionPrevious = "motion_previous",
    /// Motion to the next frame.
    MotionNext = "motion_next",
    /// Variance of the beauty's pixel means.
    Variance = "variance",
    /// The picture from one half of the samples.
    HalfA = "half_a",
    /// The picture from the other half.
    HalfB = "half_b",
    /// Perceptual roughness.
    Roughness = "roughness",
    /// Numbers of objects or materials.
    Id = "id",
    /// Cryptomatte.
    Cryptomatte = "cryptomatte",
    /// Known, and no light: passed through.
    SteadyPart = "steady_part",
}

impl Role {
    /// The role of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        let name = name.trim().to_lowercase().replace(['-', ' '], "_").replace("color", "colour");
        Self::ALL.iter().copied().find(|role| role.name() == name)
    }

    /// What made the light, for passes that are terms of the beauty.
    pub const fn light(self) -> Option<LightKind> {
        Some(match self {
            Self::MatteDirect | Self::SubsurfaceDirect | Self::SheenDirect => LightKind::MatteDirect,
            Self::MatteIndirect | Self::SubsurfaceIndirect | Self::SheenIndirect => LightKind::MatteIndirect,
            // Direct light in it has edges that must stay.
            Self::Matte | Self::Subsurface | Self::Sheen => LightKind::MatteDirect,
            Self::GlossyDirect | Self::CoatDirect => LightKind::GlossyDirect,
            Self::GlossyIndirect | Self::CoatIndirect | Self::Glossy | Self::Coat => LightKind::GlossyIndirect,
            Self::TransmissionDirect | Self::TransmissionIndirect | Self::Transmission => LightKind::Transmission,
            Self::VolumeDirect | Self::VolumeIndirect | Self::Volume => LightKind::Volume,
            Self::Emission | Self::Environment => LightKind::NoiseFree,
            _ => return None,
        })
    }

    /// The role of what multiplies this light, where there can be one.
    pub const fn colour(self) -> Option<Self> {
        Some(match self {
            Self::MatteDirect | Self::MatteIndirect | Self::Matte => Self::MatteColour,
            Self::SubsurfaceDirect | Self::SubsurfaceIndirect | Self::Subsurface => Self::SubsurfaceColour,
            Self::GlossyDirect | Self::GlossyIndirect | Self::Glossy => Self::GlossyColour,
            Self::TransmissionDirect | Self::TransmissionIndirect | Self::Transmission => Self::TransmissionColour,
            _ => return None,
        })
    }

    /// True where a layer may have several of them.
    pub const fn repeats(self) -> bool {
        matches!(self, Self::LightGroup | Self::Cryptomatte | Self::Id | Self::SteadyPart)
    }

    /// How many channels it has at least and at most.
    pub const fn channels(self) -> [usize; 2] {
        match self {
            Self::Alpha | Self::Depth | Self::SeenDepth | Self::Roughness => [1, 1],
            Self::Normal | Self::SeenNormal | Self::Position => [3, 3],
            Self::Motion => [2, 4],
            Self::MotionPrevious | Self::MotionNext => [2, 3],
            Self::Variance => [1, 3],
            Self::Id | Self::Cryptomatte | Self::SteadyPart => [1, 4],
            _ => [1, 3],
        }
    }
}

impl std::fmt::Display for Role {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
