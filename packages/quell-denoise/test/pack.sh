#!/usr/bin/env bash
# The npm package as a user meets it: packed, installed in a fresh folder, imported, its types checked, and the page of examples/three with
# it. What cannot be had is skipped by name. `bash packages/quell-denoise/test/pack.sh FOLDER`, from anywhere.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
place=$(mkdir -p "$1" && cd "$1" && pwd)
quiet=(--no-audit --no-fund --loglevel=error)

rm -rf "$place"/*.tgz "$place/use" "$place/three"
(cd "$root/packages/quell-denoise" && npm pack --loglevel=error --pack-destination "$place" >/dev/null)
packed=$(echo "$place"/quell-denoise-*.tgz)
bytes=$(wc -c <"$packed")
echo "packed: $bytes bytes"
if ((bytes > 300000)); then
    echo "more than 300 kB"
    exit 1
fi

mkdir "$place/use"
cd "$place/use"
echo '{ "name": "use", "private": true, "type": "module" }' >package.json
npm install "${quiet[@]}" "$packed"
for licence in LICENSE-MIT LICENSE-APACHE; do
    cmp "node_modules/quell-denoise/$licence" "$root/$licence"
done
node --input-type=module --eval '
    import * as quell from "quell-denoise";
    import { readFileSync } from "node:fs";
    const types = readFileSync("node_modules/quell-denoise/src/index.d.ts", "utf8");
    const declared = [...types.matchAll(/^export (?:class|const|function) (\w+)/gm)].map((found) => found[1]).sort();
    if (declared.join() !== Object.keys(quell).sort().join()) throw new Error(`declared: ${declared}; exported: ${Object.keys(quell)}`);
    const crate = readFileSync(process.argv[1], "utf8").match(/^version = "(.+)"$/m)[1];
    const { version } = JSON.parse(readFileSync("node_modules/quell-denoise/package.json", "utf8"));
    if (version !== crate) throw new Error(`version ${version}, but the crates have ${crate}`);
    console.log(`imported: ${declared.join(", ")}`);
' "$root/Cargo.toml"

if npm install "${quiet[@]}" --save-dev 'typescript@^7'; then
    cp "$root/packages/quell-denoise/test/types.ts" .
    npx --no-install tsc --strict --noEmit --target es2022 --module nodenext --lib es2022,dom types.ts
    echo "types: tsc --strict takes them"
else
    echo "SKIPPED: npm does not install typescript here: types"
fi

cp -r "$root/examples/three" "$place/three"
rm -rf "$place/three/node_modules" "$place/three/package-lock.json"
if ! (cd "$place/three" && npm install "${quiet[@]}" "$packed"); then
    rm -rf "$place/three"
    echo "SKIPPED: npm does not install three here: the page of examples/three"
fi
