#!/usr/bin/env bash
# Fast tests with the kernels that NumPy's BLAS takes on other processors, and with code that Numba
# compiles for any x86-64 (no fused multiply-add). Runs them all, then fails if one has failed.
set -uo pipefail
cd "$(dirname "$0")/.."

failed=()

tests() {
    printf 'processors: %s\n' "$*"
    env "$@" $PYTEST -m "not slow" --ignore=tests/benchmarks "${ARGS[@]}" || failed+=("$*")
}

ARGS=("$@")
tests OPENBLAS_CORETYPE=Prescott
tests OPENBLAS_CORETYPE=Haswell
if grep -qs avx512f /proc/cpuinfo; then
    tests OPENBLAS_CORETYPE=SkylakeX
else
    printf 'processors: SkylakeX is left out, this processor has no AVX-512\n'
fi
tests OPENBLAS_CORETYPE=Prescott NUMBA_CPU_NAME=generic

if [ ${#failed[@]} -gt 0 ]; then
    printf 'processors: tests failed with %s\n' "${failed[@]}"
    exit 1
fi
