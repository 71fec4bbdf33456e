#!/usr/bin/env bash
# Makes .venv/bin/slideviz, with everything to run and test it, in the versions of constraints.txt.
# Does nothing where all is there. `tools/setup.sh docs` adds what builds the documentation.
# `tools/setup.sh run` installs only what slideviz runs with, and leaves compilation to first use.
#
# PYTHON=/path/to/python chooses the interpreter; SYSTEM_PACKAGES=no leaves apt alone.
set -euo pipefail
cd "$(dirname "$0")/.."

VENV=.venv
STAMP=$VENV/.installed${1:+-$1}
case "${1:-}" in
run) EXTRAS= ;;
*) EXTRAS=test,dev${1:+,$1} ;;
esac
# What the Qt and VTK wheels expect of the system, and a font.
PACKAGES=(
    fonts-dejavu-core
    libgl1 libegl1 libglx-mesa0 libopengl0 libglib2.0-0 libdbus-1-3 libfontconfig1 libxrender1
    libxkbcommon-x11-0 libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0
    libxcb-render-util0 libxcb-shape0 libxcb-xinerama0 libxcb-xfixes0
)
# A screen that is not there (Xvfb) for the tests of the window, and MPI, which mpi4py has not, for
# the tests of runs on several ranks.
[ -z "$EXTRAS" ] || PACKAGES+=(xvfb xauth xdotool openmpi-bin)

say() { printf 'setup: %s\n' "$*"; }
fail() { printf 'setup: %s\n' "$*" >&2; exit 1; }

has_apt() { [ "${SYSTEM_PACKAGES:-yes}" != no ] && command -v apt-get dpkg-query >/dev/null; }
is_root() { [ "$(id -u)" -eq 0 ]; }

installed() {
    # Newer releases of Debian call some libraries NAMEt64.
    grep -qx installed <<<"$(dpkg-query -W -f '${db:Status-Status}\n' "$1" "$1t64" 2>/dev/null)"
}

apt_install() {
    say "installing with apt: $*"
    export DEBIAN_FRONTEND=noninteractive
    # A fresh machine has no package lists, and an old one has lists of files long gone.
    apt-get update -qq </dev/null &&
        apt-get install -y -qq --no-install-recommends "$@" </dev/null >/dev/null
}

install_system_packages() {
    has_apt || return 0
    local missing=() name
    for name in "${PACKAGES[@]}"; do
        installed "$name" || missing+=("$name")
    done
    [ ${#missing[@]} -eq 0 ] && return 0
    if is_root; then
        apt_install "${missing[@]}" || fail "apt could not install: ${missing[*]}"
    else
        say "the window and its tests need system packages; without them the rest works. Run:"
        say "    sudo apt-get install ${missing[*]}"
    fi
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-python3.11 python3.12 python3.13 python3}; do
        if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return 0
        fi
    done
    return 1
}

choose_python() {
    python=$(find_python) && return 0
    [ -z "${PYTHON:-}" ] || fail "PYTHON=$PYTHON is not Python 3.11 or newer"
    if has_apt && is_root; then
        apt_install python3 python3-venv || fail "apt could not install python3 and python3-venv"
        python=$(find_python) && return 0
    fi
    fail "Python 3.11 or newer is needed; install it, or name it: make setup PYTHON=/path/to/python"
}

# Debian keeps the part that makes virtual environments in a package of its own.
require_venv_module() {
    "$python" -c 'import ensurepip, venv' 2>/dev/null && return 0
    local package
    package=$("$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')
    if has_apt && is_root; then
        apt_install "$package" || fail "apt could not install $package"
        "$python" -c 'import ensurepip, venv' 2>/dev/null && return 0
    fi
    fail "$python cannot make virtual environments. Run: sudo apt-get install $package"
}

make_venv() {
    # A venv breaks when its interpreter is removed or the project's folder is moved.
    if grep -qsF "$(pwd -P)/$VENV/bin" $VENV/bin/pip &&
        $VENV/bin/python -c 'import pip, sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null
    then
        return 0
    fi
    choose_python
    require_venv_module
    # A link to the environment of another copy: that one is not ours to clear.
    if [ -L $VENV ]; then rm $VENV; fi
    say "making $VENV with $("$python" --version)"
    "$python" -m venv --clear $VENV
}

# All that decides what pip would install.
fingerprint() { { $VENV/bin/python --version; cat pyproject.toml constraints.txt; } | sha256sum; }

is_installed() {
    local now stamp stamps=("$STAMP")
    [ -x $VENV/bin/slideviz ] || return 1
    [ -n "$EXTRAS" ] || stamps+=("$VENV/.installed") # which has more
    now=$(fingerprint)
    for stamp in "${stamps[@]}"; do
        [ "$(cat "$stamp" 2>/dev/null)" != "$now" ] || return 0
    done
    return 1
}

install_slideviz() {
    if is_installed; then return 0; fi
    say "installing slideviz${EXTRAS:+ [$EXTRAS]} into $VENV (up to some minutes the first time)"
    rm -f "$STAMP"
    $VENV/bin/python -m pip install --quiet --disable-pip-version-check \
        --constraint constraints.txt --editable ".${EXTRAS:+[$EXTRAS]}" \
        </dev/null || fail "pip could not install slideviz; its message is above"
    # Else each process of the tests would do it.
    [ -z "$EXTRAS" ] || compile_numerics
    fingerprint >"$STAMP"
}

compile_numerics() {
    say "compiling the numerics (a minute)"
    $VENV/bin/python -c 'from slideviz.session.jit_warmup import warm_up
warm_up(lambda: None, lambda: False)' </dev/null || say "not compiled; the first command does it"
}

install_system_packages
make_venv
install_slideviz
say "ready: $VENV/bin/slideviz"
