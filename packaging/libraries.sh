#!/usr/bin/env bash
# What the wheel is linked with, into build/wheel/lib, or build/wheel_aarch64/lib if it is compiled for aarch64 on another CPU; fast when it
# is there:
#   Embree, fmt and OMPL, static, from Debian's sources of the very versions whose headers apt.txt installs;
#   glibc 2.28 as a linker sees it (names and versions, no code), from ziglang, so that the wheel runs wherever that is.
# Every other static library comes with Debian's -dev packages. usage: packaging/libraries.sh PYTHON_WITH_ZIGLANG [ARCHITECTURE]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=$(realpath -s "$1")
arch=${2:-$(uname -m)}
work=$PWD/build/wheel
cxx=g++ ar=ar sysroot=
toolchain=()
if [ "$arch" != "$(uname -m)" ]; then
  work+=_$arch
  sysroot=$PWD/build/${arch}_sysroot
  cxx="$arch-linux-gnu-g++ --sysroot=$sysroot" ar=$arch-linux-gnu-ar
  toolchain=(-DCMAKE_TOOLCHAIN_FILE="$PWD/cmake/$arch.cmake")
fi
lib=$work/lib
glibc=2.28
jobs=${MJSENSE_JOBS:-$(nproc)}
mkdir -p "$work/src" "$lib"

say() { printf '\033[1m%s\033[0m\n' "$*" >&2; }

# An apt that knows the sources of what this machine's apt installs.
apt=$work/apt
source_apt() {
  mkdir -p "$apt/lists/partial" "$apt/parts"
  rm -f "$apt"/parts/*
  local file
  for file in /etc/apt/sources.list /etc/apt/sources.list.d/*; do
    case $file in
      *.sources) sed 's/^Types: deb$/Types: deb-src/' "$file" > "$apt/parts/$(basename "$file")" ;;
      *.list) [ ! -f "$file" ] || sed -n 's/^deb /deb-src /p' "$file" > "$apt/parts/$(basename "$file")" ;;
    esac
  done
  apt-get -q -o Dir::Etc::sourcelist=/dev/null -o Dir::Etc::sourceparts="$apt/parts" \
    -o Dir::State::lists="$apt/lists" -o APT::Sandbox::User=root "$@"
}

# fetch PACKAGE DEV_PACKAGE: unpacks the source of the installed version; prints its folder.
fetch() {
  local installed name=$1
  installed=$(dpkg-query -W -f '${source:Upstream-Version}' "$2")
  if ! ls "$work/src/${name}_$installed".orig.tar.* >/dev/null 2>&1; then
    (cd "$work/src" && source_apt update >&2 && source_apt source --tar-only "$name" >&2)
  fi
  rm -rf "$work/src/$name"
  mkdir "$work/src/$name"
  tar -xf "$work/src/${name}_$installed".orig.tar.* -C "$work/src/$name" --strip-components 1
  echo "$work/src/$name"
}

build_embree() {
  local src
  src=$(fetch embree libembree-dev)
  # mjsense uses triangles and round linear curves; the other curves take most of the compile time.
  sed -i -E '/vtbl\[Geometry::GTY_/{/GTY_ROUND_LINEAR_CURVE/!d}' "$src"/kernels/geometry/curve_intersector_virtual_*.cpp
  local unused=() name isas
  if [ "$arch" = x86_64 ]; then
    # Files compiled for AVX only are compiled for AVX2 instead, and selected on machines with AVX2.
    sed -i 's/SET(ISA_LOWEST_AVX 2)/SET(ISA_LOWEST_AVX 3)/' "$src/CMakeLists.txt"
    sed -i 's/^  IF (${ISA} EQUAL ${AVX})$/  IF (${ISA} EQUAL ${ISA_LOWEST_AVX})/' "$src/kernels/CMakeLists.txt"
    sed -i 's/^#define SELECT_SYMBOL_AVX(features,intersector)$/& if ((features \& AVX2) == AVX2) intersector = avx2::intersector;/' \
      "$src/kernels/common/isa.h"
    isas=(-DEMBREE_ISA_SSE2=ON -DEMBREE_ISA_SSE42=OFF -DEMBREE_ISA_AVX=OFF -DEMBREE_ISA_AVX2=ON -DEMBREE_ISA_AVX512=ON)
  else
    isas=(-DEMBREE_ARM=ON -DEMBREE_IGNORE_CMAKE_CXX_FLAGS=OFF -DCMAKE_CXX_FLAGS=-flax-vector-conversions)  # NEON
  fi
  rm -rf "$work/embree"
  for name in QUAD GRID SUBDIVISION INSTANCE USER POINT; do unused+=("-DEMBREE_GEOMETRY_$name=OFF"); done
  cmake -S "$src" -B "$work/embree" -G Ninja -Wno-dev -DCMAKE_BUILD_TYPE=Release -DCMAKE_POSITION_INDEPENDENT_CODE=ON \
    -DCMAKE_CXX_COMPILER_LAUNCHER=ccache \
    -DEMBREE_STATIC_LIB=ON -DEMBREE_TASKING_SYSTEM=INTERNAL -DEMBREE_ISPC_SUPPORT=OFF -DEMBREE_TUTORIALS=OFF -DBUILD_TESTING=OFF \
    -DEMBREE_MAX_ISA=NONE "${isas[@]}" "${unused[@]}" "${toolchain[@]}" >&2
  cmake --build "$work/embree" -j "$jobs" >&2
  # One archive, because its parts depend on each other in cycles.
  { echo "create $lib/libembree.a"; find "$work/embree" -name '*.a' -printf 'addlib %p\n'; printf 'save\nend\n'; } | $ar -M
}

build_fmt() {
  local src
  src=$(fetch fmtlib libfmt-dev)
  # With the installed headers and the macros of the shared library, so that both are compiled equally.
  $cxx -std=c++20 -O2 -fPIC -DFMT_SHARED -DFMT_EXPORT -c "$src/src/format.cc" -o "$work/src/fmt.o"
  $ar rcs "$lib/libfmt.a" "$work/src/fmt.o"
}

build_ompl() {
  local src includes
  src=$(fetch ompl libompl-dev)/src/ompl
  includes=$(echo "$sysroot"/usr/include/ompl-1.*)
  # RRT-Connect and what it names; the linker drops from that what is not called (other planners, spaces).
  (cd "$src" && ls base/src/*.cpp {base/goals,base/samplers,base/samplers/informed,base/spaces,util}/src/*.cpp \
    base/objectives/src/PathLength*.cpp base/spaces/constraint/src/ConstrainedStateSpace.cpp \
    geometric/src/Path{Geometric,Simplifier}.cpp geometric/planners/rrt/src/RRTConnect.cpp tools/config/src/SelfConfig.cpp |
    grep -v -E 'PlannerData|StateStorage|PrecomputedStateSampler' && echo "$OLDPWD/packaging/ompl_without_boost.cc") > "$work/ompl.files"
  rm -rf "$work/ompl" "$lib/libompl.a"
  mkdir "$work/ompl"
  (cd "$src" && xargs -P "$jobs" -I FILE sh -c 'ccache $2 -std=c++17 -O2 -fPIC -ffunction-sections -fdata-sections -w \
    -isystem "$0" -isystem "$3/usr/include/eigen3" -c FILE -o "$1/$(basename FILE).o"' "$includes" "$work/ompl" "$cxx" "$sysroot" < "$work/ompl.files")
  $ar rcs "$lib/libompl.a" "$work"/ompl/*.o
}

build_glibc() {
  local cache=$work/zig stubs=$lib/glibc name
  rm -rf "$stubs" "$cache"
  mkdir -p "$stubs" "$cache"
  echo 'int main(void) { return 0; }' > "$work/src/empty.c"
  ZIG_GLOBAL_CACHE_DIR=$cache ZIG_LOCAL_CACHE_DIR=$cache "$python" -m ziglang cc -target $arch-linux-gnu.$glibc \
    "$work/src/empty.c" -o "$work/src/empty" -lm -lpthread -ldl -lrt >&2
  cp "$(dirname "$(find "$cache" -name libc.so.6)")"/*.so.* "$(find "$cache" -name libc_nonshared.a)" "$stubs"
  local loader=ld-linux-x86-64.so.2
  [ "$arch" = x86_64 ] || loader=ld-linux-$arch.so.1
  mv "$stubs"/libld.so.* "$stubs/$loader"
  for name in m pthread dl rt; do ln -s "$(cd "$stubs" && echo lib$name.so.*)" "$stubs/lib$name.so"; done
  echo "GROUP ( $stubs/libc.so.6 $stubs/libc_nonshared.a AS_NEEDED ( $stubs/$loader ) )" > "$stubs/libc.so"
}

# once FILE WHAT FUNCTION: makes a file unless the same recipe has made it.
once() {
  local recipe
  recipe=$(declare -f fetch "$3" | sha256sum)
  [ -f "$1" ] && [ "$(cat "$work/$3.recipe" 2>/dev/null)" = "$recipe" ] && return
  say "$2 (once)"
  "$3"
  echo "$recipe" > "$work/$3.recipe"
}
once "$lib/libembree.a" "building Embree" build_embree
once "$lib/libfmt.a" "building fmt" build_fmt
once "$lib/libompl.a" "building OMPL" build_ompl
once "$lib/glibc/libc.so" "preparing glibc $glibc" build_glibc
