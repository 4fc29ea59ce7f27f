#!/usr/bin/env bash
# Builds quell live as a page: a folder of four files that any web server serves.
#
#   bash crates/quell-live/web/build.sh [FOLDER [ARGUMENTS OF CARGO BUILD]]      default: quell-live-web in cargo's target folder
#
# It takes rustup's target wasm32-unknown-unknown, which it installs; or a compiler in $RUSTC that can build for it.
set -euo pipefail
web=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$web/../../.."
target=${CARGO_TARGET_DIR:-target}
[[ $target == /* ]] || target=$PWD/$target
folder=${1:-$target/quell-live-web}
shift || true
triple=wasm32-unknown-unknown

if [[ -z ${RUSTC:-} && ! -d $(rustc --print sysroot)/lib/rustlib/$triple ]]; then
    rustup target add "$triple"
fi

# Every browser with WebGPU has these vectors.
RUSTFLAGS="${RUSTFLAGS:-} -C target-feature=+simd128" \
    cargo build --locked --profile page -p quell-live --bin quell-live --target "$triple" "$@"

# The version of wasm-bindgen's tool must be that of its library.
version=$(awk '$0 == "name = \"wasm-bindgen\"" { getline; gsub(/"/, ""); print $3 }' Cargo.lock)
if ! grep -q "wasm-bindgen-cli-support = \"=$version\"" "$web/bindgen/Cargo.toml"; then
    echo "error: Cargo.lock has wasm-bindgen $version: write that into $web/bindgen/Cargo.toml" >&2
    exit 1
fi
# It runs on this machine, whatever the page is compiled with.
(cd "$web/bindgen" && env -u RUSTC -u RUSTFLAGS cargo build --locked --release --target-dir "$target/bindgen")

mkdir -p "$folder"
"$target/bindgen/release/bindgen" "$target/$triple/page/quell-live.wasm" "$folder"
cp "$web/index.html" "$web/page.js" "$folder"
wc -c "$folder"/*
echo "serve it, for example: python3 -m http.server -d $folder"
