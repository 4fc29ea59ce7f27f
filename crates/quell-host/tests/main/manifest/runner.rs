//! Runs frames from a manifest: makes textures, buffers and pipelines, fills uniforms by their layout, binds and
//! dispatches. Of quell it takes the crate wgpu, no type.

use quell::gpu::wgpu;
use serde_json::Value;
use std::collections::HashMap;
use wgpu::util::DeviceExt;

/// A format for [`Input`]: the one that the manifest gives the resource.
pub const OWN: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

/// What a texture of the host's holds.
pub struct Input {
    pub format: wgpu::TextureFormat,
    /// Rows without gaps.
    pub bytes: Vec<u8>,
}

struct Dispatch {
    pipeline: wgpu::ComputePipeline,
    groups: [u32; 3],
    bindings: Value,
}

pub struct Runner<'a> {
    device: &'a wgpu::Device,
    queue: &'a wgpu::Queue,
    manifest: Value,
    extent: [u32; 2],
    dispatches: Vec<Dispatch>,
    /// Own textures; two where they alternate.
    textures: HashMap<String, Vec<wgpu::Texture>>,
    tables: HashMap<String, Vec<u8>>,
    counts: HashMap<String, wgpu::Buffer>,
    turn: usize,
}

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("{value} is no text"))
}

fn number(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list"))
}

fn format(name: &str) -> wgpu::TextureFormat {
    use wgpu::TextureFormat as F;
    match name {
        "rgba16float" => F::Rgba16Float,
        "rgba32float" => F::Rgba32Float,
        "rgba32uint" => F::Rgba32Uint,
        "rg32uint" => F::Rg32Uint,
        "r32uint" => F::R32Uint,
        "r32float" => F::R32Float,
        "r8unorm" => F::R8Unorm,
        "r8uint" => F::R8Uint,
        "depth32float" => F::Depth32Float,
        other => panic!("unknown format {other}"),
    }
}

/// `width`, `ceil(width / 8)`, `1`.
fn formula(text: &str, extent: [u32; 2]) -> u32 {
    if let Some(inner) = text.strip_prefix("ceil(").and_then(|t| t.strip_suffix(')')) {
        let (a, b) = inner.split_once(" / ").expect("a quotient");
        return formula(a, extent).div_ceil(formula(b, extent));
    }
    match text {
        "width" => extent[0],
        "height" => extent[1],
        digits => digits.parse().unwrap_or_else(|_| panic!("unknown formula {digits}")),
    }
}

/// The bytes of a struct: members by name at their offsets.
fn filled(structs: &Value, name: &str, values: &Value) -> Vec<u8> {
    let mut bytes = vec![0; number(&structs[name]["bytes"]) as usize];
    for member in list(&structs[name]["members"]) {
        let value = &values[text(&member["name"])];
        assert!(!value.is_null(), "{name}.{} has no value", member["name"]);
        let numbers = |bits: fn(f64) -> [u8; 4]| -> Vec<u8> {
            let one = |v: &Value| bits(v.as_f64().unwrap_or_else(|| panic!("{v} is no number")));
            match value.as_array() {
                Some(parts) => parts.iter().flat_map(one).collect(),
                None => one(value).to_vec(),
            }
        };
        let float = |v: f64| (v as f32).to_le_bytes();
        let part = match text(&member["type"]) {
            "f32" | "vec2f" | "vec3f" | "vec4f" => numbers(float),
            "u32" | "vec2u" => numbers(|v| (v as u32).to_le_bytes()),
            // Each element takes the place of four numbers.
            "array<vec3f, 3>" => {
                let rows = list(value).iter().map(|row| list(row).iter().chain([&Value::Null]));
                rows.flatten().flat_map(|v| float(v.as_f64().unwrap_or_default())).collect()
            }
            inner => filled(structs, inner, value),
        };
        let offset = number(&member["offset"]) as usize;
        bytes[offset..offset + part.len()].copy_from_slice(&part);
    }
    bytes
}

impl<'a> Runner<'a> {
    pub fn new(
        device: &'a wgpu::Device,
        queue: &'a wgpu::Queue,
        files: &HashMap<&str, &[u8]>,
        manifest: &str,
        extent: [u32; 2],
    ) -> Self {
        let manifest: Value = serde_json::from_slice(files[manifest]).expect("JSON");
        let mut runner = Self {
            device,
            queue,
            extent,
            dispatches: Vec::new(),
            textures: HashMap::new(),
            tables: HashMap::new(),
            counts: HashMap::new(),
            turn: 0,
            manifest,
        };
        for resource in list(&runner.manifest["resources"]) {
            let name = text(&resource["name"]).to_owned();
            match text(&resource["role"]) {
                "input" => {}
                "taps" => {
                    runner.tables.insert(name, files[text(&resource["file"])].to_vec());
                }
                "counts" => {
                    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
                        label: Some(&name),
                        size: number(&resource["bytes"]),
                        usage: wgpu::BufferUsages::STORAGE
                            | wgpu::BufferUsages::COPY_DST
                            | wgpu::BufferUsages::COPY_SRC,
                        mapped_at_creation: false,
                    });
                    runner.counts.insert(name, buffer);
                }
                _ => {
                    let size = ["width", "height"].map(|side| formula(text(&resource[side]), extent));
                    let make = |_| runner.texture(&name, format(text(&resource["format"])), size);
                    let copies = (0..number(&resource["copies"])).map(make).collect();
                    runner.textures.insert(name, copies);
                }
            }
        }
        let made = list(&runner.manifest["dispatches"]).iter().map(|d| runner.dispatch(d, files)).collect();
        runner.dispatches = made;
        runner
    }

    fn texture(&self, name: &str, format: wgpu::TextureFormat, extent: [u32; 2]) -> wgpu::Texture {
        use wgpu::TextureFormat as F;
        use wgpu::TextureUsages as Usage;
        let mut usage = Usage::TEXTURE_BINDING | Usage::COPY_DST | Usage::COPY_SRC;
        // What stands in for what is absent, and a host's vectors: no WebGPU stores to them.
        if !matches!(format, F::R8Unorm | F::R8Uint | F::Depth32Float) {
            usage |= Usage::STORAGE_BINDING;
        }
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(name),
            size: wgpu::Extent3d { width: extent[0], height: extent[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    fn dispatch(&self, described: &Value, files: &HashMap<&str, &[u8]>) -> Dispatch {
        let source = String::from_utf8(files[text(&described["file"])].to_vec()).expect("UTF-8");
        let label = Some(text(&described["name"]));
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(source.into()),
        });
        let entries: Vec<_> = list(&described["bindings"]).iter().map(layout_entry).collect();
        let layout =
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(text(&described["entry_point"])),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let groups = list(&described["workgroups"]);
        Dispatch {
            pipeline,
            groups: std::array::from_fn(|k| formula(text(&groups[k]), self.extent)),
            bindings: described["bindings"].clone(),
        }
    }

    /// Runs a frame. `uniforms`: what the host fills of each uniform by its name, beyond the values of the manifest.
    pub fn frame(&mut self, index: i64, uniforms: &Value, inputs: &HashMap<&str, Input>) {
        self.turn = 1 - self.turn;
        let mut of_host = HashMap::new();
        for (name, input) in inputs {
            let texture = match self.textures.get(*name) {
                Some(copies) => &copies[self.turn % copies.len()],
                None => &*of_host.entry(*name).or_insert_with(|| self.texture(name, input.format, self.extent)),
            };
            assert!(input.format == OWN || input.format == texture.format());
            let row = texture.format().block_copy_size(None).expect("a size") * self.extent[0];
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
            self.queue.write_texture(texture.as_image_copy(), &input.bytes, layout, texture.size());
        }
        let buffer = |bytes: &[u8], usage| {
            self.device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: None, contents: bytes, usage })
        };
        let structs = &self.manifest["structs"];
        let mut small = HashMap::new();
        for uniform in list(&self.manifest["uniforms"]) {
            let mut values = uniform.get("values").and_then(Value::as_object).cloned().unwrap_or_default();
            let host = uniforms[text(&uniform["name"])].as_object().cloned().unwrap_or_default();
            values.extend(host);
            if list(uniform.get("per_frame").unwrap_or(&Value::Array(Vec::new()))).contains(&"there".into()) {
                values.insert("there".to_owned(), self.there(inputs).into());
            }
            let bytes = filled(structs, text(&uniform["struct"]), &Value::Object(values));
            small.insert(text(&uniform["name"]), buffer(&bytes, wgpu::BufferUsages::UNIFORM));
        }
        for resource in list(&self.manifest["resources"]).iter().filter(|r| r["role"] == "taps") {
            let (bytes, period) = (number(&resource["bytes"]) as usize, number(&resource["period"]) as i64);
            let start = index.rem_euclid(period) as usize * bytes;
            let table = &self.tables[text(&resource["name"])][start..start + bytes];
            small.insert(text(&resource["name"]), buffer(table, wgpu::BufferUsages::STORAGE));
        }
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (name, buffer) in &self.counts {
            encoder.clear_buffer(buffer, 0, None);
            small.insert(name, buffer.clone());
        }
        for dispatch in &self.dispatches {
            let view = |binding: &Value| {
                let name = text(&binding["resource"]);
                let before = usize::from(binding["copy"] == "before");
                let own = |name| self.textures.get(name).map(|copies| &copies[(self.turn + before) % copies.len()]);
                let stand_in = || own(text(&self.resource(name)["if_absent"]));
                let texture = own(name).or_else(|| of_host.get(name)).or_else(stand_in);
                let texture = texture.unwrap_or_else(|| panic!("no texture {name}"));
                texture.create_view(&wgpu::TextureViewDescriptor::default())
            };
            let bindings = list(&dispatch.bindings);
            let views: Vec<Option<wgpu::TextureView>> = bindings
                .iter()
                .map(|b| matches!(text(&b["kind"]), "texture" | "storage_texture").then(|| view(b)))
                .collect();
            let entries: Vec<_> = bindings
                .iter()
                .zip(&views)
                .map(|(b, view)| {
                    let name = if b["kind"] == "uniform" { &b["uniform"] } else { &b["resource"] };
                    let resource = match view {
                        Some(view) => wgpu::BindingResource::TextureView(view),
                        None => small[text(name)].as_entire_binding(),
                    };
                    wgpu::BindGroupEntry { binding: number(&b["binding"]) as u32, resource }
                })
                .collect();
            let layout = dispatch.pipeline.get_bind_group_layout(0);
            let descriptor = wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries };
            let group = self.device.create_bind_group(&descriptor);
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&dispatch.pipeline);
            pass.set_bind_group(0, &group, &[]);
            let [x, y, z] = dispatch.groups;
            pass.dispatch_workgroups(x, y, z);
        }
        self.queue.submit([encoder.finish()]);
    }

    fn resource(&self, name: &str) -> &Value {
        let found = list(&self.manifest["resources"]).iter().find(|r| r["name"] == name);
        found.unwrap_or_else(|| panic!("no resource {name}"))
    }

    /// The sum of what the inputs that may be absent add to it.
    fn there(&self, inputs: &HashMap<&str, Input>) -> u64 {
        let optional = inputs.keys().map(|name| self.resource(name)).filter(|r| r["optional"] == true);
        optional.map(|r| number(&r["there"])).fold(0, |all, bits| all | bits)
    }

    /// What was counted in the last frame.
    pub fn counts(&self, name: &str) -> Vec<u8> {
        let buffer = &self.counts[name];
        let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
        self.mapped(encoder, &copy)
    }

    fn mapped(&self, encoder: wgpu::CommandEncoder, copy: &wgpu::Buffer) -> Vec<u8> {
        self.queue.submit([encoder.finish()]);
        copy.map_async(wgpu::MapMode::Read, .., |result| result.expect("mapped"));
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("it ends");
        copy.get_mapped_range(..).expect("a range").to_vec()
    }

    /// What the outputs of the last frame hold, by their names.
    pub fn outputs(&self) -> HashMap<String, Vec<u8>> {
        let outputs = self.manifest["outputs"].as_object().expect("names");
        let read = |(name, resource): (&String, &Value)| {
            let copies = &self.textures[text(resource)];
            (name.clone(), self.read(&copies[self.turn % copies.len()]))
        };
        outputs.iter().map(read).collect()
    }

    fn read(&self, texture: &wgpu::Texture) -> Vec<u8> {
        let row = texture.format().block_copy_size(None).expect("a size") * texture.width();
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let copy = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded) * u64::from(texture.height()),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let target = wgpu::TexelCopyBufferInfo { buffer: &copy, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
        let bytes = self.mapped(encoder, &copy);
        bytes.chunks_exact(padded as usize).flat_map(|r| r[..row as usize].to_vec()).collect()
    }
}

fn layout_entry(binding: &Value) -> wgpu::BindGroupLayoutEntry {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let view_dimension = wgpu::TextureViewDimension::D2;
    let ty = match text(&binding["kind"]) {
        "uniform" => buffer(wgpu::BufferBindingType::Uniform),
        "read-only-storage" => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
        "storage" => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
        "texture" => wgpu::BindingType::Texture {
            sample_type: match text(&binding["sample_type"]) {
                "uint" => wgpu::TextureSampleType::Uint,
                "depth" => wgpu::TextureSampleType::Depth,
                "unfilterable-float" => wgpu::TextureSampleType::Float { filterable: false },
                other => panic!("unknown sample type {other}"),
            },
            view_dimension,
            multisampled: false,
        },
        "storage_texture" => wgpu::BindingType::StorageTexture {
            access: wgpu::StorageTextureAccess::WriteOnly,
            format: format(text(&binding["format"])),
            view_dimension,
        },
        other => panic!("unknown kind {other}"),
    };
    let binding = number(&binding["binding"]) as u32;
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}
