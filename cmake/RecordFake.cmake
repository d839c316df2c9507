# Writes recordings that the Python tests read, kill and resume, and that bench/record.py times.
add_executable(record_fake ${PROJECT_SOURCE_DIR}/tests/record/fake_writer.cc
                           ${PROJECT_SOURCE_DIR}/src/mjsense/record/testing/fake_suite.cc)
target_link_libraries(record_fake PRIVATE mjsense ${MJSENSE_PRIVATE_LIBS})
