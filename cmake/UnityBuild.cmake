# SPDX-License-Identifier: Apache-2.0
# mjsense_unity(TARGET SIZE SOURCE...): compiles up to SIZE files of a room together, because most files spend more time on the
# headers that they include than on their own lines. CPU seconds without ccache (preset dev): both libraries 305 instead of 585 in
# groups of eight, tests and bindings 465 instead of 744 in groups of four. Files with compile options of their own
# (cmake/Isa.cmake) are compiled alone. Missing includes of a file are found by ./dev check, in which clang examines each file
# alone.
function(mjsense_unity target size)
  set(sources ${ARGN})
  list(FILTER sources INCLUDE REGEX "\\.cc$")
  list(SORT sources)
  foreach(file IN LISTS sources)
    string(REGEX REPLACE "^.*/(src/mjsense[^/]*|python)/([^/]+)/.*" "\\2" room ${file})
    get_source_file_property(options ${file} COMPILE_OPTIONS)
    if(NOT options)
      math(EXPR count_${room} "0${count_${room}} + 1")
      math(EXPR group "(${count_${room}} - 1) / ${size}")
      set_source_files_properties(${file} PROPERTIES UNITY_GROUP ${room}${group})
    endif()
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()
