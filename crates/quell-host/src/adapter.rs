//! Which adapters there are, and which one is meant.

use crate::device::now;
use crate::error::Error;
use quell::gpu::wgpu;
use wgpu::DeviceType;

/// Which adapter a user wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted<'a> {
    /// A GPU: discrete, else integrated, else virtual. Never one in software.
    Any,
    /// The one whose name holds this, capitals or not; one in software as well.
    Named(&'a str),
}

/// An adapter by what a user sees of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Adapter {
    /// As its driver calls it.
    pub name: String,
    /// Discrete, integrated, virtual, other, or in software.
    pub kind: DeviceType,
    /// The graphics API, and the driver's version.
    pub driver: String,
}

impl Adapter {
    pub(super) fn of(info: &wgpu::AdapterInfo) -> Self {
        let driver = [info.backend.to_str(), &info.driver, &info.driver_info];
        let driver = driver.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(", ");
        Self { name: info.name.clone(), kind: info.device_type, driver }
    }

    /// Whether it runs on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == DeviceType::Cpu
    }

    /// Discrete, integrated and so on, in words.
    pub const fn kind_name(&self) -> &'static str {
        match self.kind {
            DeviceType::DiscreteGpu => "discrete GPU",
            DeviceType::IntegratedGpu => "integrated GPU",
            DeviceType::VirtualGpu => "virtual GPU",
            DeviceType::Cpu => "software",
            DeviceType::Other => "unknown kind",
        }
    }

    /// The smaller, the sooner it is taken unnamed; `None`: never. What kind a driver does not tell may be a CPU.
    const fn rank(&self) -> Option<u8> {
        match self.kind {
            DeviceType::DiscreteGpu => Some(0),
            DeviceType::IntegratedGpu => Some(1),
            DeviceType::VirtualGpu => Some(2),
            DeviceType::Cpu | DeviceType::Other => None,
        }
    }
}

impl std::fmt::Display for Adapter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}; {})", self.name, self.kind_name(), self.driver)
    }
}

/// What wgpu finds on this machine, best first.
pub fn adapters() -> Vec<Adapter> {
    let mut found: Vec<Adapter> = enumerate().iter().map(|a| Adapter::of(&a.get_info())).collect();
    found.sort_by_key(|a| a.rank().unwrap_or(u8::MAX));
    found
}

fn enumerate() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    now(instance.enumerate_adapters(wgpu::Backends::all()))
}

/// The adapter that is meant.
pub(super) fn find(wanted: Wanted<'_>) -> Result<wgpu::Adapter, Error> {
    let mut found = enumerate();
    let seen: Vec<Adapter> = found.iter().map(|a| Adapter::of(&a.get_info())).collect();
    let chosen = choose(&seen, wanted)?;
    Ok(found.swap_remove(chosen))
}

/// Index of the adapter that is meant; of two that are alike the first.
fn choose(seen: &[Adapter], wanted: Wanted<'_>) -> Result<usize, Error> {
    match wanted {
        Wanted::Any => {
            let ranked = seen.iter().enumerate().filter_map(|(i, a)| a.rank().map(|rank| (rank, i)));
            ranked.min().map(|(_, i)| i).ok_or_else(|| Error::NoGpu {
                found: match seen.first() {
                    None => list(seen),
                    Some(first) => format!("{}; select it by name: --device {}", list(seen), word(first)),
                },
            })
        }
        Wanted::Named(asked) => {
            let lower = asked.to_lowercase();
            let named = seen.iter().enumerate().filter(|(_, a)| a.name.to_lowercase().contains(&lower));
            let ranked = named.map(|(i, a)| (a.rank().unwrap_or(u8::MAX), i));
            ranked
                .min()
                .map(|(_, i)| i)
                .ok_or_else(|| Error::UnknownDevice { asked: asked.to_owned(), found: list(seen) })
        }
    }
}

fn list(seen: &[Adapter]) -> String {
    match seen {
        [] => "wgpu finds no adapter (no driver for Vulkan, Metal or DX12)".to_owned(),
        [one] => format!("there is only {one}"),
        many => format!("there are {}", many.iter().map(Adapter::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// What names an adapter on a command line: the first word of its name.
fn word(adapter: &Adapter) -> &str {
    adapter.name.split_whitespace().next().unwrap_or("NAME")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(name: &str, kind: DeviceType) -> Adapter {
        Adapter { name: name.to_owned(), kind, driver: "vulkan".to_owned() }
    }

    #[test]
    fn a_real_gpu_is_taken_and_software_only_when_named() {
        let software = adapter("llvmpipe (LLVM 15.0.6, 256 bits)", DeviceType::Cpu);
        let integrated = adapter("Intel(R) UHD Graphics 770", DeviceType::IntegratedGpu);
        let discrete = adapter("NVIDIA GeForce", DeviceType::DiscreteGpu);
        let seen = [software.clone(), integrated, discrete];
        let index = |seen: &[Adapter], wanted| choose(seen, wanted).map_err(|e| e.to_string());
        assert_eq!(index(&seen, Wanted::Any), Ok(2));
        assert_eq!(index(&seen[..2], Wanted::Any), Ok(1));
        assert_eq!(index(&seen, Wanted::Named("uhd")), Ok(1));
        assert_eq!(index(&seen, Wanted::Named("LLVMpipe")), Ok(0));
        let error = index(&seen[..1], Wanted::Any).unwrap_err();
        assert!(error.contains("there is only llvmpipe") && error.contains("--device llvmpipe"), "{error}");
        let error = index(&seen, Wanted::Named("voodoo")).unwrap_err();
        assert!(error.contains("`voodoo`") && seen.iter().all(|a| error.contains(&a.name)), "{error}");
        for wanted in [Wanted::Any, Wanted::Named("x")] {
            let error = index(&[], wanted).unwrap_err();
            assert!(error.contains("finds no adapter"), "{error}");
        }
        // A kind that the driver does not tell is no promise.
        assert!(index(&[adapter("x", DeviceType::Other)], Wanted::Any).is_err());
    }
}
