//! Data passes in lossy compressions, from headers alone.

use super::finding::{Diagnosis, Figure, Finding, Severity};
use crate::image::{ExrImage, SampleKind};
use crate::roles::{ChannelId, Mapping, Role};

/// What a compression does to a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Loss {
    None,
    /// 24 bits of 32: 1.5e-5.
    Slight,
    Heavy,
}

/// By the file format's own rules (OpenEXR's technical introduction, and measured on real files: frames README).
fn loss(compression: &str, kind: SampleKind, name: &str) -> Loss {
    match compression {
        // Chosen by the last word of the name: colours and luminance are quantised after a cosine transform.
        "DWAA" | "DWAB" if kind != SampleKind::Uint => {
            let last = name.rsplit('.').next().unwrap_or(name).to_uppercase();
            let lossy = match last.as_str() {
                "Y" | "BY" | "RY" => true,
                "R" | "G" | "B" => kind == SampleKind::Half,
                _ => false,
            };
            if lossy { Loss::Heavy } else { Loss::None }
        }
        "B44" | "B44A" if kind == SampleKind::Half => Loss::Heavy,
        "PXR24" if kind == SampleKind::Float => Loss::Slight,
        _ => Loss::None,
    }
}

const DATA: [Role; 12] = [
    Role::Normal,
    Role::SeenNormal,
    Role::Depth,
    Role::SeenDepth,
    Role::Position,
    Role::Motion,
    Role::MotionPrevious,
    Role::MotionNext,
    Role::Id,
    Role::Cryptomatte,
    Role::Variance,
    Role::Roughness,
];

pub(super) fn judge(mapping: &Mapping, images: &[ExrImage], number: i64, found: &mut Diagnosis) {
    let channel = |id: &ChannelId| {
        let part = images.get(id.file)?.parts().get(id.part)?;
        let channel = part.channels().get(id.channel)?;
        Some((part.compression(), channel.kind(), channel.name()))
    };
    let (mut heavy, mut slight, mut looked) = (Vec::new(), Vec::new(), 0);
    for pass in mapping.passes.iter().filter(|pass| DATA.contains(&pass.role)) {
        for (compression, kind, name) in pass.channels.iter().filter_map(channel) {
            looked += 1;
            match loss(compression, kind, name) {
                Loss::None => {}
                Loss::Slight => slight.push((compression, kind, name)),
                Loss::Heavy => heavy.push((compression, kind, name)),
            }
        }
    }
    let names = |list: &[(&str, SampleKind, &str)]| {
        let names: Vec<String> = list.iter().take(6).map(|(_, _, name)| format!("`{name}`")).collect();
        let more = if list.len() > 6 { format!(" and {} more", list.len() - 6) } else { String::new() };
        names.join(", ") + &more
    };
    let stored = |list: &[(&str, SampleKind, &str)]| {
        let mut kinds: Vec<String> = list.iter().map(|(c, k, _)| format!("{} {c}", k.name())).collect();
        kinds.sort();
        kinds.dedup();
        kinds.join(", ")
    };
    if let Some((compression, _, first)) = heavy.first() {
        let why = if compression.starts_with("DWA") {
            "; DWA takes every channel whose name ends in Y for luminance"
        } else {
            ""
        };
        found.findings.push(
            Finding::new("codec.lossy", Severity::Warning, "data passes are stored in a lossy compression")
                .frame(number)
                .channel(*first)
                .evidence(
                    format!("{} of {looked} data channels: {} ({}){why}", heavy.len(), names(&heavy), stored(&heavy)),
                    vec![Figure::new("damaged channels", heavy.len() as f64, "channels")],
                )
                .cure(
                    "normals, positions and vectors are off by blocks: surfaces are taken apart or run together",
                    "write the data passes with ZIP, or the whole file (Blender: Output > Codec: ZIP)",
                ),
        );
    }
    if let Some((_, _, first)) = slight.first() {
        found.findings.push(
            Finding::new("codec.rounded", Severity::Note, "data passes are stored with 24 bits")
                .frame(number)
                .channel(*first)
                .evidence(
                    format!(
                        "{} of {looked} data channels: {} ({}): relative error 1.5e-5",
                        slight.len(),
                        names(&slight),
                        stored(&slight)
                    ),
                    vec![Figure::new("rounded channels", slight.len() as f64, "channels")],
                )
                .cure(
                    "nothing that is seen; ids and Cryptomatte would not survive it",
                    "none needed; ZIP loses nothing",
                ),
        );
    }
    if looked > 0 && heavy.is_empty() && slight.is_empty() {
        found.pass("codec.lossy", format!("{looked} data channels, each stored without loss"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_of_the_format() {
        use SampleKind::{Float, Half, Uint};
        for (compression, kind, name, expected) in [
            ("DWAA", Float, "Normal.Y", Loss::Heavy),
            ("DWAB", Half, "Vector.y", Loss::Heavy),
            ("DWAA", Float, "Normal.X", Loss::None),
            ("DWAA", Half, "motion.R", Loss::Heavy),
            ("DWAA", Float, "motion.R", Loss::None),
            ("DWAA", Uint, "id.Y", Loss::None),
            ("B44", Half, "Normal.X", Loss::Heavy),
            ("B44A", Float, "Normal.X", Loss::None),
            ("PXR24", Float, "Depth.Z", Loss::Slight),
            ("PXR24", Half, "Depth.Z", Loss::None),
            ("ZIP", Half, "Vector.Y", Loss::None),
        ] {
            assert_eq!(loss(compression, kind, name), expected, "{compression} {kind:?} {name}");
        }
    }
}
