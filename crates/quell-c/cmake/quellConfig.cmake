# find_package(quell): the targets quell::quell (shared) and quell::static.
get_filename_component(_quell_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
if(NOT TARGET quell::quell)
    add_library(quell::quell SHARED IMPORTED)
    set_target_properties(quell::quell PROPERTIES
        IMPORTED_LOCATION "${_quell_prefix}/lib/libquell.so"
        IMPORTED_SONAME "libquell.so.0"
        INTERFACE_INCLUDE_DIRECTORIES "${_quell_prefix}/include")
    add_library(quell::static STATIC IMPORTED)
    set_target_properties(quell::static PROPERTIES
        IMPORTED_LOCATION "${_quell_prefix}/lib/libquell.a"
        INTERFACE_LINK_LIBRARIES "gcc_s;util;rt;pthread;m;dl;c"
        INTERFACE_INCLUDE_DIRECTORIES "${_quell_prefix}/include")
endif()
