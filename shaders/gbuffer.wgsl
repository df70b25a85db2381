// gbuffer
