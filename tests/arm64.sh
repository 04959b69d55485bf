#!/usr/bin/env bash
# arm64.sh COMPOSITION...: tests/bits.py on arm64, emulated: Debian's Python and PyPI's wheels for it under qemu-user.
# Needs qemu-aarch64 (Debian: qemu-user), apt-get and the environment of env.sh; nothing is installed. Without names all.
# Some minutes at first, since kernels are compiled by the emulated processor.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
folder=$here/../out/arm64
mkdir -p "$folder"/{apt/lists/partial,apt/archives/partial,root,wheels,site}
cd "$folder"
if [ ! -e ready ]; then
    options=(-q -o APT::Architecture=arm64 -o APT::Architectures=arm64 -o Dir::State::lists="$folder/apt/lists"
        -o Dir::State::status=/dev/null -o Dir::Cache="$folder/apt" -o APT::Sandbox::User=)
    apt-get "${options[@]}" update
    python=$(apt-cache "${options[@]}" depends python3-minimal | sed -n 's/.*Depends: \(python3\.[0-9]*\)-minimal.*/\1/p' | head -1)
    (cd apt && apt-get "${options[@]}" download "$python-minimal" "lib$python-minimal" "lib$python-stdlib" \
        libc6 zlib1g libexpat1 libffi8 libssl3 libbz2-1.0 liblzma5 libsqlite3-0 libstdc++6 libgcc-s1 libuuid1)
    for package in apt/*.deb; do dpkg -x "$package" root; done
    # The versions of this environment.
    pip list --format=freeze | grep -iE '^(numpy|scipy|numba|llvmlite|pydantic|pydantic.core|pyyaml|annotated.types|typing.extensions|typing.inspection|rich|pygments|markdown.it.py|mdurl|pandas|python.dateutil|tzdata|packaging|six|h5py|xarray)==' > versions
    platforms=()
    for glibc in 17 24 27 28; do platforms+=(--platform "manylinux_2_${glibc}_aarch64"); done
    pip download -q --no-deps --only-binary=:all: --platform manylinux2014_aarch64 "${platforms[@]}" \
        --python-version "${python#python}" -d wheels -r versions
    for wheel in wheels/*.whl; do python3 -m zipfile -e "$wheel" site; done
    # What Python takes for itself: a process that it starts is emulated too.
    printf '#!/bin/sh\nexec qemu-aarch64 -0 "$0" -L "%s" "%s" "$@"\n' "$folder/root" "$folder/root/usr/bin/$python" > python
    chmod +x python
    touch ready
fi
# With its entry point, by which the law is found.
pip install -q --no-deps --upgrade --target "$folder/site" "$here/../afm_predictive"
PYTHONPATH=$folder/site:$here/../afm_model:$here/.. NUMBA_CACHE_DIR=$folder/kernels exec ./python "$here/bits.py" "$@"
