// The shapes that cross module borders. No code: types only, for `tsc --checkJs`.

/**
 * A track as it stands on the wire (`GET /api/v1/picture`, topic `tracks`). Absent values are null.
 * @typedef {object} Track
 * @property {number} id  never given again in a run of the service
 * @property {number|null} [number]  ASTERIX track number, shown in place of the id
 * @property {number} time  UTC seconds of the state
 * @property {number|null} lat
 * @property {number|null} lon
 * @property {number} east_m
 * @property {number} north_m
 * @property {number|null} speed_mps
 * @property {number|null} course_deg
 * @property {number|null} heading_deg
 * @property {number|null} [axis_deg]  bearing of the long axis as radars see it, 0 to 180
 * @property {number|null} length_m
 * @property {number|null} width_m
 * @property {string|null} class  aircraft, vehicle, unknown
 * @property {string|null} callsign
 * @property {string|null} address
 * @property {string|null} phase  tentative, confirmed, coasting
 * @property {string|null} zone
 * @property {string|null} runway
 * @property {string[]|null} sources
 * @property {number|null} accuracy_m  longer half axis of the ellipse that holds the position with 95 %
 * @property {number|null} [accuracy_minor_m]
 * @property {number|null} [accuracy_bearing_deg]  of the longer axis, 0 to 180
 * @property {boolean|null} simulated
 * @property {number|null} [altitude_m]
 * @property {boolean|null} [on_ground]
 */

/**
 * @typedef {object} AlertTarget
 * @property {number} track  its id
 * @property {number|null} [number]  its ASTERIX track number
 * @property {string|null} [callsign]
 * @property {string|null} [class]
 * @property {number|null} [east_m]
 * @property {number|null} [north_m]
 */

/**
 * @typedef {object} Alert
 * @property {number} id
 * @property {string} rule
 * @property {'information'|'alarm'} stage
 * @property {'information'|'alarm'|null} [worst_stage] the gravest that it ever had
 * @property {'new'|'ongoing'|'acknowledged'|'cleared'} state
 * @property {string} text
 * @property {number|null} raised_at
 * @property {number|null} updated_at
 * @property {number|null} cleared_at
 * @property {string|null} clear_reason
 * @property {number|null} acknowledged_at
 * @property {string|null} acknowledged_by
 * @property {string|null} runway
 * @property {string|null} holding_point
 * @property {number|null} time_to_threshold_s
 * @property {boolean} aural
 * @property {boolean} degraded
 * @property {boolean} simulated
 * @property {AlertTarget[]} targets
 */

/**
 * @typedef {object} RunwayState
 * @property {string} id
 * @property {boolean} open
 * @property {string|null} in_use
 * @property {'normal'|'low'} visibility
 * @property {number[]} occupants
 * @property {number|null} next_arrival
 * @property {number|null} next_arrival_s
 */

/**
 * @typedef {object} SensorState
 * @property {string} id
 * @property {string} kind
 * @property {string} status  ok, degraded, silent, waiting
 * @property {number|null} last
 * @property {boolean} simulated
 * @property {string} detail
 * @property {Record<string, number>} counters
 * @property {Record<string, string>} [parts]  of a radar: the methods that work on its video, by verb
 * @property {number|null} [clock_offset_s]  its clock less the time of arrival; positive is ahead
 * @property {number|null} [clock_spread_s]
 */

/**
 * `GET /api/v1/radars/{id}/parts`: what works on a radar's video, what could, and what it costs.
 * @typedef {object} RadarParts
 * @property {string} radar
 * @property {Record<string, {name: string}>} running  by verb; the settings are beside the name
 * @property {Record<string, {name: string}>|null} next
 * @property {number|null} scans_left
 * @property {number} plots_a_scan
 * @property {Record<string, number>} ms_a_turn
 * @property {Record<string, number>} cut
 * @property {Record<string, {name: string, about: string}[]>} available
 */

/**
 * `GET /api/v1/replay`: where the replay of a recording stands. Times are UTC s of the recording.
 * @typedef {object} ReplayState
 * @property {string} source  name of the recording
 * @property {number} begin
 * @property {number} end
 * @property {number} time
 * @property {boolean} playing
 * @property {number} speed  times the recorded pace
 * @property {number[]} gaps
 */

/**
 * What is shown of one target: its newest track and how it moves on the screen.
 * @typedef {object} Target
 * @property {Track} track
 * @property {number} baseMs  local clock when the newest track arrived
 * @property {number} ageS  how old the state was then
 * @property {number} ve  m/s
 * @property {number} vn  m/s
 * @property {number} offsetE  what the old picture was off by, fading away
 * @property {number} offsetN
 * @property {number|null} heading  rad, clockwise from north
 * @property {number} headingOffset  rad, fading away
 * @property {number} coastingSince  UTC s when it began to coast, NaN when it does not
 * @property {number} goneMs  local clock when it left the feed, 0 while it is there
 * @property {{e: number, n: number, t: number}[]} history
 * @property {LabelPlace} label
 * @property {number} x  screen position in this frame, CSS pixels
 * @property {number} y
 * @property {number} e  position in this frame, metres
 * @property {number} n
 */

/**
 * Where a label lies relative to its target, CSS pixels.
 * @typedef {object} LabelPlace
 * @property {number} slot  -1 when it has none
 * @property {number} dx  wanted offset of the box's corner from the target
 * @property {number} dy
 * @property {number} sx  offset shown now, following the wanted one
 * @property {number} sy
 * @property {number} w
 * @property {number} h
 * @property {boolean} visible
 * @property {{dx: number, dy: number}|null} pinned
 * @property {LabelText|null} text
 */

/**
 * @typedef {object} LabelText
 * @property {string} first
 * @property {string} second
 * @property {string} mark  a small tag after the first line
 */

/** @typedef {'off'|'short'|'full'} LabelLevel */

/**
 * A palette. `css` become custom properties of the page; the rest is for the canvases.
 * @typedef {object} Theme
 * @property {string} name
 * @property {Record<string, string>} css
 * @property {Record<string, string>} map
 * @property {Record<string, string>} ink
 */

/**
 * A feature of the map in local metres, ready to draw.
 * @typedef {object} MapFeature
 * @property {string} id
 * @property {string} kind  AMDB name
 * @property {string} name
 * @property {Record<string, any>} properties
 * @property {'polygon'|'line'|'point'} shape
 * @property {number[][][]} rings  polygons: rings; lines: lines; points: one ring of one point
 * @property {{e: number, n: number}} centre
 */

/**
 * @typedef {object} RunwayEndShape
 * @property {string} designator
 * @property {number} e
 * @property {number} n
 * @property {number} heading  rad, of a landing
 */

/**
 * @typedef {object} RunwayShape
 * @property {string} id
 * @property {[RunwayEndShape, RunwayEndShape]} ends
 * @property {number} width
 * @property {number[][][]} rings
 */

/**
 * @typedef {object} AirportMap
 * @property {string} icao
 * @property {string} name
 * @property {string} attribution
 * @property {import('./geo/projection.js').Projection} projection
 * @property {MapFeature[]} features
 * @property {RunwayShape[]} runways
 * @property {{west: number, east: number, south: number, north: number}} bounds
 */

export {};
