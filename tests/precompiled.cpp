// An object needs a source; what it is for is precompiled.h.
