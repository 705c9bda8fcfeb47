# Target doc: the interfaces of the installed headers as HTML, in doc/html of the build folder. What Doxygen finds wrong
# in a comment, such as a parameter that is no longer there, stops it.
find_package(Doxygen QUIET)
if(NOT DOXYGEN_FOUND)
  message(STATUS "No target doc: Doxygen is not installed")
  return()
endif()

# What sgf_library() installs, and the MRPT module's own.
get_property(folders GLOBAL PROPERTY SGF_PUBLIC_FOLDERS)
file(GLOB modules "${PROJECT_SOURCE_DIR}/mrpt_modules/*/include")

set(DOXYGEN_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/doc")
set(DOXYGEN_PROJECT_NAME "sgf")
set(DOXYGEN_PROJECT_BRIEF "${PROJECT_DESCRIPTION}")
set(DOXYGEN_PROJECT_NUMBER "${PROJECT_VERSION}")
set(DOXYGEN_USE_MDFILE_AS_MAINPAGE "${PROJECT_SOURCE_DIR}/docs/api.md")
set(DOXYGEN_FILE_PATTERNS *.h)
set(DOXYGEN_EXCLUDE_PATTERNS *-inl.h)
set(DOXYGEN_FILTER_PATTERNS "\"*.h=awk -f ${PROJECT_SOURCE_DIR}/cmake/file_comment.awk\"")
# Files are named as they are included.
set(DOXYGEN_STRIP_FROM_PATH "${PROJECT_SOURCE_DIR}/src" ${modules})
set(DOXYGEN_STRIP_FROM_INC_PATH "${PROJECT_SOURCE_DIR}/src" ${modules})

set(DOXYGEN_JAVADOC_AUTOBRIEF YES)
set(DOXYGEN_EXTRACT_ALL YES)
set(DOXYGEN_EXCLUDE_SYMBOLS *::*internal* *::HWY_NAMESPACE std)
set(DOXYGEN_BUILTIN_STL_SUPPORT YES)
set(DOXYGEN_DISTRIBUTE_GROUP_DOC YES)
set(DOXYGEN_SORT_MEMBER_DOCS NO)
set(DOXYGEN_INCLUDE_PATH "${PROJECT_BINARY_DIR}/include")
set(DOXYGEN_MACRO_EXPANSION YES)
set(DOXYGEN_EXPAND_ONLY_PREDEF YES)
set(DOXYGEN_PREDEFINED SGF_ALWAYS_INLINE= SGF_FLATTEN=)

set(DOXYGEN_GENERATE_LATEX NO)
set(DOXYGEN_USE_MATHJAX NO)
set(DOXYGEN_HAVE_DOT NO)
set(DOXYGEN_QUIET YES)
set(DOXYGEN_WARNINGS YES)
set(DOXYGEN_WARN_IF_UNDOCUMENTED NO)
set(DOXYGEN_WARN_IF_DOC_ERROR YES)
set(DOXYGEN_WARN_IF_INCOMPLETE_DOC NO) # a comment tells of the parameters that need it
set(DOXYGEN_WARN_AS_ERROR FAIL_ON_WARNINGS)

doxygen_add_docs(doc ${folders} ${modules} "${PROJECT_SOURCE_DIR}/docs/api.md" "${PROJECT_SOURCE_DIR}/docs/namespaces.dox"
  COMMENT "Interfaces as HTML: ${PROJECT_BINARY_DIR}/doc/html/index.html")
