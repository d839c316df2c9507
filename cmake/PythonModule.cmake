# SPDX-License-Identifier: Apache-2.0
# The Python package. The extension mjsense/_core.abi3.so is built from python/bindings with nanobind in split mode (its run-time
# part is the package nanobind-backend), so that one wheel supports every CPython from 3.11 on.
find_package(Python 3.11 REQUIRED COMPONENTS Interpreter Development.Module)
execute_process(COMMAND ${Python_EXECUTABLE} -m nanobind --cmake_dir OUTPUT_VARIABLE nanobind_ROOT
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
find_package(nanobind CONFIG REQUIRED NO_CMAKE_FIND_ROOT_PATH)

file(GLOB_RECURSE MJSENSE_PY_SOURCES CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/python/bindings/*.cc)
nanobind_add_module(mjsense_python BACKEND_MODULE nanobind_backend NOMINSIZE NB_SUPPRESS_WARNINGS ${MJSENSE_PY_SOURCES})
mjsense_unity(mjsense_python 4 ${MJSENSE_PY_SOURCES})
target_include_directories(mjsense_python PRIVATE ${PROJECT_SOURCE_DIR} ${MUJOCO_DIR}/include)
target_compile_definitions(mjsense_python PRIVATE MJSENSE_VERSION="${PROJECT_VERSION}")
target_compile_options(mjsense_python PRIVATE -Wall -Wextra -Wno-missing-field-initializers)

# HDF5 in a shared object. Debian's static libraries are compiled for executables (-fPIE). Their symbols must therefore stay inside
# the extension, which is necessary anyway because h5py loads another HDF5 into the same process, and the two libc variables that
# they use, stderr and stdout, are renamed to copies that mjsense defines.
foreach(archive ${HDF5_STATIC} ${SZ_STATIC} ${AEC_STATIC})
  get_filename_component(name ${archive} NAME_WE)
  set(shared ${PROJECT_BINARY_DIR}/${name}_shared.a)
  add_custom_command(OUTPUT ${shared} DEPENDS ${archive} COMMENT "Preparing ${name}.a for a shared object"
                     COMMAND ${CMAKE_OBJCOPY} --redefine-sym stderr=mjsense_stderr --redefine-sym stdout=mjsense_stdout
                             ${archive} ${shared})
  list(APPEND MJSENSE_PY_HDF5 ${shared})
endforeach()
add_custom_target(mjsense_python_hdf5 DEPENDS ${MJSENSE_PY_HDF5})
add_dependencies(mjsense_python mjsense_python_hdf5)

# The extension needs libmj_mjsense.so, a copy of libmujoco under a name of its own (cmake/private_mujoco.py). Where the environment's
# mujoco is of the same series, mjsense/core/libmujoco.py loads that one's libmujoco and shared/libmj_mjsense.so, an empty library of the same
# name, before the extension: the dynamic linker then takes the functions from the libmujoco that `import mujoco` uses.
set(MJSENSE_PY_DIR ${PROJECT_BINARY_DIR}/python/mjsense)
set(MJSENSE_PY_LIB ${MJSENSE_PY_DIR}/_lib)
file(GLOB MUJOCO_PLUGINS ${MUJOCO_DIR}/plugin/*.so)
add_custom_command(OUTPUT ${MJSENSE_PY_LIB}/libmj_mjsense.so
                   COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/cmake/private_mujoco.py ${MUJOCO_DIR} ${MUJOCO_LIBRARY}
                           ${MJSENSE_PY_LIB}
                   DEPENDS ${PROJECT_SOURCE_DIR}/cmake/private_mujoco.py ${MUJOCO_LIBRARY} ${MUJOCO_PLUGINS}
                   COMMENT "Copying libmujoco under a name of its own")
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/empty.c CONTENT "")
add_library(mjsense_shared_mujoco SHARED ${PROJECT_BINARY_DIR}/empty.c)
target_link_options(mjsense_shared_mujoco PRIVATE -nostdlib)
set_target_properties(mjsense_shared_mujoco PROPERTIES OUTPUT_NAME mj_mjsense LIBRARY_OUTPUT_DIRECTORY ${MJSENSE_PY_LIB}/shared)
add_custom_target(mjsense_private_mujoco DEPENDS ${MJSENSE_PY_LIB}/libmj_mjsense.so)
add_dependencies(mjsense_private_mujoco mjsense_shared_mujoco)
add_dependencies(mjsense_python mjsense_private_mujoco)
# The two libraries are named, so that CMake puts these HDF5 libraries behind them and before the ones that they link otherwise.
target_link_libraries(mjsense_python PRIVATE mjsense_tasks mjsense ${MJSENSE_PY_HDF5} ${MJSENSE_ALL_LIBS}
                                             ${MJSENSE_PY_LIB}/libmj_mjsense.so)
target_link_options(mjsense_python PRIVATE -Wl,--exclude-libs,ALL -Wl,-Bsymbolic)
if(MJSENSE_STATIC)
  target_sources(mjsense_python PRIVATE ${PROJECT_SOURCE_DIR}/packaging/old_glibc.cc)
  target_link_options(mjsense_python PRIVATE ${MJSENSE_STATIC_LINK})
endif()

# build/<preset>/python is a usable package of the extension and links to the Python files: set PYTHONPATH=build/dev/python.
set_target_properties(mjsense_python PROPERTIES OUTPUT_NAME _core LIBRARY_OUTPUT_DIRECTORY ${MJSENSE_PY_DIR}
                                                MJSENSE_MUJOCO_LATER ON INSTALL_RPATH "$ORIGIN/_lib" BUILD_WITH_INSTALL_RPATH ON)
file(GLOB_RECURSE MJSENSE_PY_FILES CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/python/mjsense
     ${PROJECT_SOURCE_DIR}/python/mjsense/*.py ${PROJECT_SOURCE_DIR}/python/mjsense/*.json
     ${PROJECT_SOURCE_DIR}/python/mjsense/py.typed)
# Links and folders of files that have moved or gone since the last configuration would still be importable.
file(GLOB MJSENSE_PY_OLD RELATIVE ${MJSENSE_PY_DIR} ${MJSENSE_PY_DIR}/*)
foreach(old IN LISTS MJSENSE_PY_OLD)
  if(NOT old MATCHES "^_(core|lib)" AND NOT EXISTS ${PROJECT_SOURCE_DIR}/python/mjsense/${old})
    file(REMOVE_RECURSE ${MJSENSE_PY_DIR}/${old})
  endif()
endforeach()
foreach(file IN LISTS MJSENSE_PY_FILES)
  get_filename_component(folder ${MJSENSE_PY_DIR}/${file} DIRECTORY)
  file(MAKE_DIRECTORY ${folder})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/python/mjsense/${file} ${MJSENSE_PY_DIR}/${file} SYMBOLIC)
endforeach()

if(CMAKE_CROSSCOMPILING)
  set(Python_EXECUTABLE ${CMAKE_SYSROOT}/emulated_python)  # imports the module
endif()
nanobind_add_stub(mjsense_stub MODULE mjsense._core OUTPUT ${MJSENSE_PY_DIR}/_core.pyi DEPENDS mjsense_python
                  PYTHON_PATH ${PROJECT_BINARY_DIR}/python)

# scikit-build-core packs python/mjsense (pyproject.toml); CMake adds the built files.
install(TARGETS mjsense_python LIBRARY DESTINATION mjsense COMPONENT python EXCLUDE_FROM_ALL)
install(DIRECTORY ${MJSENSE_PY_LIB} DESTINATION mjsense COMPONENT python EXCLUDE_FROM_ALL USE_SOURCE_PERMISSIONS)
install(FILES ${MJSENSE_PY_DIR}/_core.pyi DESTINATION mjsense COMPONENT python EXCLUDE_FROM_ALL)
