//! What a hand can do to a field: force tools, geometric tools, painting, haptics. Not built yet.
