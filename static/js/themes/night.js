// The default: a dark room, hours of it. Red is for alarm alone, amber for information alone.

/** @type {import('../types.js').Theme} */
export const night = {
  name: 'night',
  css: {
    '--ground': '#0a0e12', '--panel': '#10161c', '--panel-2': '#161e26', '--edge': '#232e38', '--edge-strong': '#34424f',
    '--text': '#c6d1da', '--text-strong': '#eaf1f6', '--text-dim': '#8796a3', '--accent': '#6fb7e8', '--accent-ink': '#08131c',
    '--ok': '#6fbf9b', '--info': '#f2b441', '--info-text': '#f2b441', '--info-ink': '#1d1402', '--info-soft': '#2b2412', '--alarm': '#f0484a',
    '--alarm-ink': '#ffffff', '--alarm-soft': '#3a1518', '--focus': '#9fd4ff', '--shadow': 'rgba(0,0,0,.5)', '--sim': '#a99bd6',
  },
  map: {
    ground: '#0a0e12', grass: '#0c1214', water: '#0b1722', road: '#131a20', apron: '#161e26', taxiway: '#202a33', shoulder: '#131a20',
    runway: '#313c47', runwayEdge: '#56646f', marking: '#8b98a3', building: '#1b2733', buildingEdge: '#384957', stand: '#26313b',
    line: '#35423a', hold: '#8a8157', holdBusy: '#f2b441', holdClosed: '#8f7fc4', closed: '#8f7fc4', text: '#77909b',
    textStand: '#55636f', textRunway: '#c2ccd4', textBuilding: '#5d6c79', halo: '#0a0e12', radar: '#7fd6a8', lowVis: '#4f6f8f',
  },
  ink: {
    aircraft: '#9bd6ff', vehicle: '#a5d6a0', unknown: '#c8bfae', text: '#dfe8ee', textDim: '#8fa0ad', leader: '#5f6f7b',
    vector: '#7fa9c4', history: '#6f95ad', alarm: '#f0484a', alarmInk: '#ffffff', info: '#f2b441', infoInk: '#1d1402',
    select: '#ffffff', sim: '#8075a8', labelBack: 'rgba(10,14,18,0.62)', tool: '#e6d9ff', toolBack: 'rgba(16,22,28,0.9)', halo: '#0a0e12',
  },
};
