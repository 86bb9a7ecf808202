# sixpoint_room(FOLDER SOURCES file... [NEIGHBOURS target...] [PRIVATE_NEIGHBOURS target...])
#
# One folder, one static library, and on its link line the only neighbours it may see: gap/features
# becomes sixpoint::gap_features. A room's headers are reached through a folder of links, one for each
# header (build/rooms/gap/features/gap/features/lines.h), which only those targets get that link to
# the room: including a header of a room that is not on the link line does not compile. The rooms
# below a folder are not in that folder's view.
add_library(sixpoint_warnings INTERFACE)
target_compile_options(sixpoint_warnings INTERFACE -Wall -Wextra -Wconversion -Wshadow)
if(SIXPOINT_WERROR)
  target_compile_options(sixpoint_warnings INTERFACE -Werror)
endif()
if(SIXPOINT_SANITIZE)
  # ThreadSanitizer cannot be joined with the others.
  set(sanitizers $<IF:$<STREQUAL:${SIXPOINT_SANITIZE},thread>,thread,address$<COMMA>undefined>)
  target_compile_options(sixpoint_warnings INTERFACE
    -fsanitize=${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer
    # A third of the time of a compilation: AddressSanitizer reports what `null` and `object-size` would, and nothing here
    # makes a pointer to a wider type out of bytes.
    -fno-sanitize=null,object-size,alignment)
  target_link_options(sixpoint_warnings INTERFACE -fsanitize=${sanitizers})
endif()

function(sixpoint_room FOLDER)
  cmake_parse_arguments(ROOM "" "" "SOURCES;NEIGHBOURS;PRIVATE_NEIGHBOURS" ${ARGN})
  string(REPLACE / _ name ${FOLDER})
  set(view ${PROJECT_BINARY_DIR}/rooms/${FOLDER})
  file(REMOVE_RECURSE ${view}/${FOLDER})
  file(MAKE_DIRECTORY ${view}/${FOLDER})
  # CONFIGURE_DEPENDS: a new header gets its link at the next build.
  file(GLOB headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}/${FOLDER}
    ${PROJECT_SOURCE_DIR}/${FOLDER}/*.h)
  foreach(header ${headers})
    file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${FOLDER}/${header} ${view}/${FOLDER}/${header} SYMBOLIC)
  endforeach()
  add_library(sixpoint_${name} STATIC ${ROOM_SOURCES})
  add_library(sixpoint::${name} ALIAS sixpoint_${name})
  # For the modules of other languages (bindings/). Calls within a room stay direct all the same.
  set_target_properties(sixpoint_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_compile_options(sixpoint_${name} PRIVATE -fno-semantic-interposition)
  # Six tenths of the time of a compilation is reading headers and making code of the same templates: twelve files are
  # compiled as one. So names in the anonymous namespaces of a room's files differ.
  set_target_properties(sixpoint_${name} PROPERTIES
    UNITY_BUILD ${SIXPOINT_UNITY} UNITY_BUILD_BATCH_SIZE 12)
  # Rooms that read foreign bytes tell the fuzzer which ways were taken; without it, it flies blind. Rooms that compute
  # do not: it makes a diagnosis of a tenth of a second last twelve.
  if(SIXPOINT_FUZZ AND FOLDER MATCHES
     "^(base.*|calib|db|device.*|gap/recording|gap/unguided|gt3x.*|mocks.*|repair/rescale|repair/triage|sim|station/limits)$")
    target_compile_options(sixpoint_${name} PRIVATE -fsanitize=fuzzer-no-link)
  elseif(FOLDER MATCHES "^(cli|db|device|mocks|station)(/|$)" AND NOT FOLDER MATCHES "^station/(records|statistics)$")
    # Rooms that wait for people, devices, disks and servers gain nothing by -O3, and take a third less time to compile by
    # -O1; under the sanitizers even that takes three times as long as none.
    target_compile_options(sixpoint_${name} PRIVATE $<IF:$<BOOL:${SIXPOINT_SANITIZE}>,-O0,$<$<CONFIG:Release>:-O1>>)
  elseif(FOLDER MATCHES "^(repair/(archive|batch|report|units)|gap/(adopt|benchmark|challenge|drawing|report))$")
    # Rooms that work once for a file gain nothing by -O3 either.
    target_compile_options(sixpoint_${name} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
  target_include_directories(sixpoint_${name} PUBLIC $<BUILD_INTERFACE:${view}>)
  target_link_libraries(sixpoint_${name}
    PUBLIC ${ROOM_NEIGHBOURS}
    PRIVATE ${ROOM_PRIVATE_NEIGHBOURS} $<BUILD_INTERFACE:sixpoint_warnings>)
endfunction()

# sixpoint_part(FOLDER NAME): the room as a library that the program loads when it first needs it
# (base/parts/part.h). Programs find it in the folder of their RUNPATH. What links to the room instead has
# its table inside, which is asked for by name because nothing else refers to it.
set(SIXPOINT_PARTS_DESTINATION lib/sixpoint)
set(CMAKE_BUILD_RPATH ${PROJECT_BINARY_DIR}/${SIXPOINT_PARTS_DESTINATION})
function(sixpoint_part FOLDER NAME)
  string(REPLACE / _ room ${FOLDER})
  target_link_options(sixpoint_${room} INTERFACE -Wl,-u,sixpoint_part_${NAME})
  add_library(sixpoint_part_${NAME} MODULE $<TARGET_OBJECTS:sixpoint_${room}>)
  target_link_libraries(sixpoint_part_${NAME} PRIVATE sixpoint_${room} sixpoint_warnings)
  target_link_options(sixpoint_part_${NAME} PRIVATE -Wl,--exclude-libs,ALL -Wl,--as-needed)
  set_target_properties(sixpoint_part_${NAME} PROPERTIES
    OUTPUT_NAME sixpoint-${NAME}-${PROJECT_VERSION} LINKER_LANGUAGE CXX SKIP_BUILD_RPATH ON
    LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BUILD_RPATH})
  install(TARGETS sixpoint_part_${NAME} DESTINATION ${SIXPOINT_PARTS_DESTINATION} COMPONENT program)
  set_property(GLOBAL APPEND PROPERTY SIXPOINT_PARTS sixpoint_part_${NAME})
endfunction()

# sixpoint_wing(FOLDER room...): all rooms of a folder under one name, for tests, benchmarks and other
# projects. No room links to a wing.
function(sixpoint_wing FOLDER)
  add_library(sixpoint_${FOLDER} INTERFACE)
  add_library(sixpoint::${FOLDER} ALIAS sixpoint_${FOLDER})
  foreach(room ${ARGN})
    target_link_libraries(sixpoint_${FOLDER} INTERFACE sixpoint::${FOLDER}_${room})
  endforeach()
endfunction()
