#!/usr/bin/env bash
# Makes build/folder/slideviz with PyInstaller: a folder that runs without Python and pip, and
# dist/slideviz-VERSION-linux-MACHINE.tar.xz of it.
#
# PYTHON=/path/to/python chooses the interpreter that goes into the folder; ARCHIVE=no leaves the
# archive out.
set -euo pipefail
cd "$(dirname "$0")/.."
. packaging/need.sh

# Python with its shared library, what PyInstaller reads libraries with, and those that Qt loads,
# which go into the folder. OpenGL stays the system's.
need python3-venv libpython3.11 binutils xz-utils libegl1 libgl1 libx11-xcb1 libdbus-1-3 \
    libfontconfig1 libglib2.0-0 libxkbcommon-x11-0 libxcb-cursor0 libxcb-icccm4 libxcb-image0 \
    libxcb-keysyms1 libxcb-randr0 libxcb-render-util0 libxcb-shape0 libxcb-xfixes0 libxcb-xkb1

python=${PYTHON:-/usr/bin/python3}
work=build/folder
venv=$work/venv
version=$(sed -n 's/^__version__ = "\(.*\)"$/\1/p' slideviz/__init__.py)

mkdir -p $work dist
[ -x $venv/bin/python ] || "$python" -m venv $venv
$venv/bin/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
    '.[packages]' </dev/null
rm -rf $work/slideviz
$venv/bin/pyinstaller --noconfirm --log-level WARN --workpath $work/pyinstaller \
    --distpath $work packaging/slideviz.spec
# The folder may be read-only: without these files each start would compile slideviz's sources.
$venv/bin/python -m compileall -q --invalidation-mode unchecked-hash $work/slideviz/_internal/slideviz
printf 'folder: %s, %s\n' $work/slideviz "$(du -sh $work/slideviz | cut -f1)"
if [ "${ARCHIVE:-yes}" != no ]; then
    archive=dist/slideviz-$version-linux-$(uname -m).tar.xz
    tar --create --owner=0 --group=0 --directory=$work slideviz | xz -T0 -3 >"$archive"
    printf 'folder: %s, %s\n' "$archive" "$(du -h "$archive" | cut -f1)"
fi
