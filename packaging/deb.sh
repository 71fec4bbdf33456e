#!/usr/bin/env bash
# Makes dist/slideviz_VERSION_ARCHITECTURE.deb for Debian 12 and what is newer, from the folder that
# packaging/folder.sh makes.
#
# MAINTAINER="Name <mail>" is who answers for the package. CHECK=no leaves lintian out.
set -euo pipefail
cd "$(dirname "$0")/.."
. packaging/need.sh

need dpkg-dev
[ "${CHECK:-yes}" = no ] || need lintian appstream desktop-file-utils
ARCHIVE=${ARCHIVE:-no} packaging/folder.sh

version=$(sed -n 's/^__version__ = "\(.*\)"$/\1/p' slideviz/__init__.py)
architecture=$(dpkg --print-architecture)
maintainer=${MAINTAINER:-The slideviz authors <slideviz@localhost>}
folder=build/folder/slideviz
python=build/folder/venv/bin/python
tree=build/deb
shared=packaging/shared
seconds=$(git log -1 --format=%ct 2>/dev/null || date +%s)
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$seconds}

fill() { # fill FILE < TEMPLATE
    sed -e "s|@VERSION@|$version|" -e "s|@ARCHITECTURE@|$architecture|" \
        -e "s|@MAINTAINER@|$maintainer|" -e "s|@SIZE@|${size:-0}|" \
        -e "s|@DATE@|$(date -u -d "@$SOURCE_DATE_EPOCH" +%Y-%m-%d)|" >"$1"
}
pack() { gzip -9n >"$1"; }

rm -rf $tree
mkdir -p $tree/DEBIAN $tree/usr/{bin,lib} dist
cp -a $folder $tree/usr/lib/slideviz
ln -s ../lib/slideviz/slideviz $tree/usr/bin/slideviz
ln -s ../lib/slideviz/slideviz $tree/usr/bin/slideviz-window

cd $tree/usr
mkdir -p share/{applications,metainfo,mime/packages,icons/hicolor/scalable/apps,man/man1} \
    share/{bash-completion/completions,zsh/vendor-completions,fish/vendor_completions.d} \
    share/doc/slideviz share/lintian/overrides
cd - >/dev/null
share=$tree/usr/share
cp slideviz/gui/desktop/slideviz.desktop $share/applications/
cp slideviz/gui/desktop/slideviz.svg $share/icons/hicolor/scalable/apps/
QT_QPA_PLATFORM=offscreen $python -P packaging/icons.py $share/icons/hicolor
cp $shared/slideviz.xml $share/mime/packages/
fill $share/metainfo/slideviz.metainfo.xml <$shared/slideviz.metainfo.xml
$python -P packaging/man.py build/slideviz.1
pack $share/man/man1/slideviz.1.gz <build/slideviz.1
ln -s slideviz.1.gz $share/man/man1/slideviz-window.1.gz
$folder/slideviz completion bash >$share/bash-completion/completions/slideviz
$folder/slideviz completion zsh >$share/zsh/vendor-completions/_slideviz
$folder/slideviz completion fish >$share/fish/vendor_completions.d/slideviz.fish
cp packaging/debian/lintian-overrides $share/lintian/overrides/slideviz
sed -e 's/^$/./' -e 's/^/ /' LICENSE >build/license
sed -e '/@LICENSE@/{r build/license' -e 'd}' packaging/debian/copyright >$share/doc/slideviz/copyright
pack $share/doc/slideviz/changelog.gz <<END
slideviz ($version) unstable; urgency=medium

  * See CHANGELOG.md of the sources.

 -- $maintainer  $(date -u -R -d "@$SOURCE_DATE_EPOCH")
END

chmod -R u=rwX,go=rX $tree
find $tree/usr/lib/slideviz -name '*.so*' -exec chmod 644 {} +
size=$(du -sk $tree/usr | cut -f1)
fill $tree/DEBIAN/control <packaging/debian/control
# What root compiled there is no file of the package.
printf '#!/bin/sh\nset -e\n[ "$1" = upgrade ] || rm -rf /usr/lib/slideviz\n' >$tree/DEBIAN/postrm
chmod 755 $tree/DEBIAN/postrm
(cd $tree && find usr -type f -print0 | sort -z | xargs -0 md5sum) >$tree/DEBIAN/md5sums
package=dist/slideviz_${version}_$architecture.deb
dpkg-deb --root-owner-group -Zxz -z3 --build $tree "$package" >/dev/null
printf 'deb: %s, %s\n' "$package" "$(du -h "$package" | cut -f1)"

if [ "${CHECK:-yes}" != no ]; then
    desktop-file-validate $share/applications/slideviz.desktop
    # The project has no address yet, which the identifier would begin with.
    appstreamcli validate --no-net --override=cid-desktopapp-is-not-rdns=info \
        $share/metainfo/slideviz.metainfo.xml
    lintian --fail-on error,warning "$package"
fi
