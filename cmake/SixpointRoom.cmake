# sixpoint_room(NAME SOURCES file... [NEIGHBOURS target...] [PRIVATE_NEIGHBOURS target...])
#
# One folder, one static library, and on its link line the only neighbours it may see.
# A room's headers are reached through a folder of links (build/rooms/NAME/NAME -> NAME), which
# only those targets get that link to the room: including a header of a room that is not on the
# link line does not compile.
add_library(sixpoint_warnings INTERFACE)
target_compile_options(sixpoint_warnings INTERFACE -Wall -Wextra -Wconversion -Wshadow)
if(SIXPOINT_WERROR)
  target_compile_options(sixpoint_warnings INTERFACE -Werror)
endif()
if(SIXPOINT_SANITIZE)
  target_compile_options(sixpoint_warnings INTERFACE
    -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(sixpoint_warnings INTERFACE -fsanitize=address,undefined)
endif()
if(SIXPOINT_FUZZ)
  # The rooms tell the fuzzer which ways were taken; without it, it flies blind.
  target_compile_options(sixpoint_warnings INTERFACE -fsanitize=fuzzer-no-link)
endif()

function(sixpoint_room NAME)
  cmake_parse_arguments(ROOM "" "" "SOURCES;NEIGHBOURS;PRIVATE_NEIGHBOURS" ${ARGN})
  set(view ${PROJECT_BINARY_DIR}/rooms/${NAME})
  file(MAKE_DIRECTORY ${view})
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${NAME} ${view}/${NAME} SYMBOLIC)
  add_library(sixpoint_${NAME} STATIC ${ROOM_SOURCES})
  add_library(sixpoint::${NAME} ALIAS sixpoint_${NAME})
  target_include_directories(sixpoint_${NAME} PUBLIC $<BUILD_INTERFACE:${view}>)
  target_link_libraries(sixpoint_${NAME}
    PUBLIC ${ROOM_NEIGHBOURS}
    PRIVATE ${ROOM_PRIVATE_NEIGHBOURS} $<BUILD_INTERFACE:sixpoint_warnings>)
endfunction()
