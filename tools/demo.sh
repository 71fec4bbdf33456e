#!/usr/bin/env bash
# Deforms the sample passage in two ways into demo/, and opens the better one if there is a screen.
#
# WINDOW=no leaves the window closed.
set -euo pipefail
cd "$(dirname "$0")/.."

slideviz=.venv/bin/slideviz
case=demo/passage/passage.cfg

mkdir -p demo
# Only what this script wrote: someone may keep other things in demo/.
rm -rf demo/passage demo/passage_fixed* demo/passage_sliding*
"$slideviz" sample passage -o demo/passage

printf '\n== all outer boundaries held fixed ==\n'
"$slideviz" run "$case" --set SLIDING_MODE=none --set PERIODIC_MODE=none \
    -o demo/passage_fixed.su2 --picture demo/passage_fixed.png

printf '\n== inflow and outflow slide, periodic sides move along ==\n'
"$slideviz" run "$case" -o demo/passage_sliding.su2 --picture demo/passage_sliding.png \
    --json demo/passage_sliding.json
"$slideviz" quality demo/passage_sliding.su2 --reference demo/passage/mesh.su2

describe() { printf '  %-31s %s\n' "demo/$1" "$2"; }
printf '\nwritten:\n'
describe passage/mesh.su2 'the undeformed mesh'
describe passage/passage.cfg 'the case: what moves, slides and repeats, by which method'
for method in fixed sliding; do
    describe "passage_$method.su2" "the deformed mesh, outer boundaries $method"
    describe "passage_$method.png" 'its picture: cells colored by quality'
    describe "passage_${method}_qual.txt" 'its quality, a number for each cell (GENERATE_QUALITY= YES)'
done
describe passage_sliding.json 'the report of the run, for other programs'
printf '\nOther methods compile when they are first used, up to half a minute; the window does so by itself.\n'
if [ "${WINDOW:-yes}" = no ]; then
    printf '\nthe window: %s %s\n' "$slideviz" "$case"
elif [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
    printf '\nopening the window; close it to end\n'
    "$slideviz" "$case" --run
else
    printf '\nno screen here; where there is one: %s %s\n' "$slideviz" "$case"
fi
