# SPDX-License-Identifier: Apache-2.0
# models/**.xml and models/**.toml are compiled into the library, so that the program needs no data files at run time.
file(GLOB_RECURSE MJSENSE_MODELS CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/models/*.xml ${PROJECT_SOURCE_DIR}/models/*.toml)
set(MJSENSE_EMBEDDED ${PROJECT_BINARY_DIR}/embedded_models.cc)
add_custom_command(
  OUTPUT ${MJSENSE_EMBEDDED}
  COMMAND ${Python_EXECUTABLE} ${PROJECT_SOURCE_DIR}/cmake/embed.py ${PROJECT_SOURCE_DIR}/models ${MJSENSE_EMBEDDED}
  DEPENDS ${MJSENSE_MODELS} ${PROJECT_SOURCE_DIR}/cmake/embed.py
  COMMENT "Embedding models/")
target_sources(mjsense PRIVATE ${MJSENSE_EMBEDDED})
