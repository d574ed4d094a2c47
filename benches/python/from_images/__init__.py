"""The study of volumes made from images: what is studied, how it is judged, what is shown."""
