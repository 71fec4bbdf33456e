# need PACKAGE...: installs Debian packages that are missing, as root; otherwise prints the command.
need() {
    local missing=() name
    for name in "$@"; do
        grep -qx installed <<<"$(dpkg-query -W -f '${db:Status-Status}\n' "$name" 2>/dev/null)" ||
            missing+=("$name")
    done
    [ ${#missing[@]} -gt 0 ] || return 0
    if [ "$(id -u)" -ne 0 ]; then
        printf 'packaging: first run: sudo apt-get install %s\n' "${missing[*]}" >&2
        return 1
    fi
    printf 'packaging: installing with apt: %s\n' "${missing[*]}"
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq </dev/null
    apt-get install -y -qq --no-install-recommends "${missing[@]}" </dev/null >/dev/null
}
