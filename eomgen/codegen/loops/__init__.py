"""The linear systems of closed loops in straight lines: by bodies, embedded, or by independent motions."""
