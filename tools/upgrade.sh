#!/usr/bin/env bash
# Renews constraints.txt: the newest versions that pyproject.toml allows, on the oldest Python that
# it allows, for what runs there runs on newer ones too.
#
# PYTHON=/path/to/python chooses the interpreter.
set -euo pipefail
cd "$(dirname "$0")/.."

oldest=$(sed -n 's/^requires-python = ">=\(.*\)"$/\1/p' pyproject.toml)
python=${PYTHON:-python$oldest}
if ! "$python" -c "import sys; sys.exit('%d.%d' % sys.version_info[:2] != '$oldest')" 2>/dev/null; then
    printf 'upgrade: %s is not Python %s; name one: make upgrade PYTHON=/path/to/python%s\n' \
        "$python" "$oldest" "$oldest" >&2
    exit 1
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet --disable-pip-version-check '.[test,dev,docs,peers,packages,gpu]' \
    </dev/null
{
    printf '# Versions that were tested together, on Python %s. `make upgrade` renews them.\n' "$oldest"
    "$work/venv/bin/python" -m pip freeze --exclude slideviz --exclude pip --exclude setuptools
} >"$work/constraints.txt"
mv "$work/constraints.txt" constraints.txt
chmod 644 constraints.txt
git --no-pager diff --stat constraints.txt 2>/dev/null || true
printf 'upgrade: constraints.txt is renewed; now: make setup test-all lint docs\n'
