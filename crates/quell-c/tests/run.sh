#!/usr/bin/env bash
# The C library as a program's author meets it: installed into a fresh folder, the header as C11 and C++17 with warnings as errors,
# bad input of every kind, the C++ example built by CMake; all of it under valgrind where that is installed.
#
#     cargo build --release -p quell-c && bash crates/quell-c/tests/run.sh FOLDER
set -euo pipefail
if ! command -v cc >/dev/null || ! command -v c++ >/dev/null || [[ $(uname -s) != Linux ]]; then
    echo "SKIPPED: no C and C++ compilers, or not Linux"
    exit 0
fi
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$here/../../..
rm -rf "$1"
mkdir -p "$1"
folder=$(cd "$1" && pwd)
bash "$here/../install.sh" "$folder/prefix"
strict=(-Wall -Wextra -Wpedantic -Wconversion -Werror "-I$folder/prefix/include")
echo '#include <quell.h>' > "$folder/header.c"
cc -std=c11 "${strict[@]}" -fsyntax-only "$folder/header.c"
c++ -std=c++17 "${strict[@]}" -fsyntax-only -x c++ "$folder/header.c"
# What the shared library exports is what the header declares (tests/header.rs compares the types).
if command -v nm >/dev/null; then
    nm -D --defined-only "$folder/prefix/lib/libquell.so" | awk '$3 ~ /^quell_/ { print $3 }' | sort > "$folder/exported"
    sed -n 's/^[a-z].*[ *]\(quell_[a-z_]*\)(.*);$/\1/p' "$folder/prefix/include/quell.h" | sort > "$folder/declared"
    diff "$folder/declared" "$folder/exported"
fi

check=()
if command -v valgrind >/dev/null; then
    check=(valgrind --quiet --error-exitcode=9 --leak-check=full --show-leak-kinds=definite --errors-for-leak-kinds=definite)
else
    echo "SKIPPED: no valgrind, programs run without it"
fi
export PKG_CONFIG_PATH=$folder/prefix/lib/pkgconfig
if command -v pkg-config >/dev/null; then
    flags=$(pkg-config --cflags --libs quell)
else
    flags="-I$folder/prefix/include -L$folder/prefix/lib -lquell"
fi
# The examples of docs/c.md, each a function.
awk '/^```c$/ { printf "static void example_%d(void) {\n", ++count; inside = 1; next }
     /^```$/ { if (inside) print "}"; inside = 0 }
     inside' "$root/docs/c.md" > "$folder/examples.h"
flags="$flags -I$folder"
for program in bad realtime docs; do
    # shellcheck disable=SC2086
    cc -std=c11 -D_POSIX_C_SOURCE=200809L -Wall -Wextra -Werror -g "$here/$program.c" -o "$folder/$program" $flags -lm -lpthread
    LD_LIBRARY_PATH=$folder/prefix/lib "${check[@]}" "$folder/$program"
done

if ! command -v cmake >/dev/null; then
    echo "SKIPPED: no cmake, the example is built without it"
    # shellcheck disable=SC2086
    c++ -std=c++17 -Wall -Wextra -Werror -g "$root/examples/c/main.cpp" -o "$folder/denoise_wall" $flags
    LD_LIBRARY_PATH=$folder/prefix/lib "${check[@]}" "$folder/denoise_wall"
    exit 0
fi
cmake -S "$root/examples/c" -B "$folder/example" -DCMAKE_PREFIX_PATH="$folder/prefix" -DCMAKE_BUILD_TYPE=Debug > "$folder/cmake.log"
cmake --build "$folder/example" >> "$folder/cmake.log"
"${check[@]}" "$folder/example/denoise_wall"
