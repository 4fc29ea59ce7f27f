// What every pass is told.
@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> settings: Settings;
