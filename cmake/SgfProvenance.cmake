# Writes <sgf/provenance.h>-style facts (version, git revision, compiler, flags) into a generated
# source file of sgf_core; runs save them beside their results.
find_package(Git QUIET)
set(SGF_GIT_REVISION "")
if(GIT_FOUND AND EXISTS "${PROJECT_SOURCE_DIR}/.git")
  execute_process(COMMAND ${GIT_EXECUTABLE} -C "${PROJECT_SOURCE_DIR}" describe --always --dirty
    OUTPUT_VARIABLE SGF_GIT_REVISION OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
elseif(EXISTS "${PROJECT_SOURCE_DIR}/REVISION") # the Dockerfile's
  file(STRINGS "${PROJECT_SOURCE_DIR}/REVISION" SGF_GIT_REVISION LIMIT_COUNT 1)
endif()
if(SGF_GIT_REVISION STREQUAL "")
  set(SGF_GIT_REVISION "unknown")
endif()
configure_file("${PROJECT_SOURCE_DIR}/cmake/provenance.cc.in" "${PROJECT_BINARY_DIR}/provenance.cc" @ONLY)
