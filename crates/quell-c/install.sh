#!/usr/bin/env bash
# Puts the built library where C and C++ programs find it, by CMake or pkg-config. Linux:
#
#     cargo build --release -p quell-c && bash crates/quell-c/install.sh PREFIX
set -euo pipefail
if [[ $# != 1 ]]; then
    echo "usage: install.sh PREFIX" >&2
    exit 2
fi
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$here/../..
built=${CARGO_TARGET_DIR:-$root/target}/release
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -1)
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
mkdir -p "$prefix/include" "$prefix/lib/cmake/quell" "$prefix/lib/pkgconfig" "$prefix/share/licenses/quell"
cp "$here/include/quell.h" "$prefix/include/"
cp "$built/libquell_c.so" "$prefix/lib/libquell.so.$version"
ln -sf "libquell.so.$version" "$prefix/lib/libquell.so.0"
ln -sf libquell.so.0 "$prefix/lib/libquell.so"
cp "$built/libquell_c.a" "$prefix/lib/libquell.a"
cp "$here/cmake/quellConfig.cmake" "$prefix/lib/cmake/quell/"
sed -e "s|@prefix@|$prefix|" -e "s|@version@|$version|" "$here/cmake/quell.pc.in" > "$prefix/lib/pkgconfig/quell.pc"
cp "$root/LICENSE-MIT" "$root/LICENSE-APACHE" "$prefix/share/licenses/quell/"
